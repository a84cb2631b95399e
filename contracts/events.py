"""The events of a delivery: one line each in its record (`events.jsonl`), one message each in its event stream.

`kind` says which model of `contracts.event_data` the event's `data` is. Writers are held to these models; readers are
not: `read_event` passes over a field that it does not know, and keeps an event of an unknown kind, or with data of
another shape, as an `UnknownEvent`, which still tells its number, time, phase and message.

`python -m contracts.events` prints the JSON Schema of one event: docs/events.schema.json.
"""

import json
import sys
from collections.abc import Sequence
from typing import Annotated, Any, Literal, TypeAlias, get_args

from pydantic import Field, JsonValue, TypeAdapter, ValidationError

from contracts.base import Wire
from contracts.cameras import default_rig
from contracts.event_data import (
    AnswerData,
    ApproachData,
    BuildingBoxData,
    DirectionData,
    EventData,
    FloorCountData,
    HeightCheckData,
    LookData,
    LostData,
    MoveData,
    NoData,
    OutageData,
    ParsedData,
    PlacedData,
    RefusedData,
    SearchData,
    Seconds,
    StandOffData,
    TurnData,
)
from contracts.orchestrator import DeliveryResult, OpenQuestion, Phase
from contracts.sim import Verdict


class RecordedEvent(Wire):
    """What all events have in common. `number` counts from 1 without gaps, `time_s` from the record's beginning;
    `pictures` are file names in the record's `pictures` folder."""

    number: int = Field(ge=1)
    time_s: Seconds
    phase: str
    kind: str
    message: str
    data: object
    pictures: tuple[str, ...] = ()

    def picture(self, name: str) -> str | None:
        """The file name of the picture with that short name."""
        return next((file for file in self.pictures if file.endswith(f"_{name}.jpg")), None)


class MissionEvent(RecordedEvent):
    """An event of a kind that is known here."""

    phase: Phase


class PhaseEvent(MissionEvent):
    """The next phase begins."""

    kind: Literal["phase"] = "phase"
    data: NoData = NoData()


class ParsedEvent(MissionEvent):
    kind: Literal["parsed"] = "parsed"
    data: ParsedData


class QuestionEvent(MissionEvent):
    """The customer is asked; nothing goes on before the answer, or the end of the waiting."""

    kind: Literal["question"] = "question"
    data: OpenQuestion


class AnswerEvent(MissionEvent):
    kind: Literal["answer"] = "answer"
    data: AnswerData


class PlacedEvent(MissionEvent):
    kind: Literal["placed"] = "placed"
    data: PlacedData


class StandOffEvent(MissionEvent):
    kind: Literal["stand_off"] = "stand_off"
    data: StandOffData


class FloorCountEvent(MissionEvent):
    kind: Literal["floor_count"] = "floor_count"
    data: FloorCountData


class HeightCheckEvent(MissionEvent):
    kind: Literal["height_check"] = "height_check"
    data: HeightCheckData


class BuildingBoxEvent(MissionEvent):
    kind: Literal["building_box"] = "building_box"
    data: BuildingBoxData


class LookEvent(MissionEvent):
    kind: Literal["look"] = "look"
    data: LookData


class DirectionEvent(MissionEvent):
    kind: Literal["direction"] = "direction"
    data: DirectionData


class SearchEvent(MissionEvent):
    kind: Literal["search"] = "search"
    data: SearchData


class MoveEvent(MissionEvent):
    kind: Literal["move"] = "move"
    data: MoveData


class TurnEvent(MissionEvent):
    kind: Literal["turn"] = "turn"
    data: TurnData


class ApproachEvent(MissionEvent):
    kind: Literal["approach"] = "approach"
    data: ApproachData


class LostEvent(MissionEvent):
    kind: Literal["lost"] = "lost"
    data: LostData


class RefusedEvent(MissionEvent):
    kind: Literal["refused"] = "refused"
    data: RefusedData


class OutageEvent(MissionEvent):
    """A model or a service is away and waited for, or back (`over`)."""

    kind: Literal["outage"] = "outage"
    data: OutageData


class VerdictEvent(MissionEvent):
    kind: Literal["verdict"] = "verdict"
    data: Verdict


class ResultEvent(MissionEvent):
    """The last event of a delivery."""

    kind: Literal["result"] = "result"
    data: DeliveryResult


class UnknownEvent(RecordedEvent):
    """An event of a newer (or much older) writer: its data is kept as it came."""

    data: dict[str, JsonValue] = {}


KnownEvent: TypeAlias = (
    PhaseEvent
    | ParsedEvent
    | QuestionEvent
    | AnswerEvent
    | PlacedEvent
    | StandOffEvent
    | FloorCountEvent
    | HeightCheckEvent
    | BuildingBoxEvent
    | LookEvent
    | DirectionEvent
    | SearchEvent
    | MoveEvent
    | TurnEvent
    | ApproachEvent
    | LostEvent
    | RefusedEvent
    | OutageEvent
    | VerdictEvent
    | ResultEvent
)
Event: TypeAlias = KnownEvent | UnknownEvent

_KNOWN: TypeAdapter[KnownEvent] = TypeAdapter(Annotated[KnownEvent, Field(discriminator="kind")])
_EVENT_OF: dict[object, Any] = {event.model_fields["data"].annotation: event for event in get_args(KnownEvent)}


RENAMED_KINDS = {"contour": "search"}
"""What records of version 0.1 call otherwise."""


def new_event(
    data: EventData, *, number: int, time_s: float, phase: Phase, message: str, pictures: Sequence[str] = ()
) -> KnownEvent:
    """The event that tells that data."""
    event: KnownEvent = _EVENT_OF[type(data)](
        number=number, time_s=time_s, phase=phase, message=message, data=data, pictures=tuple(pictures)
    )
    return event


def read_event(text: str | bytes) -> Event:
    """One event from JSON. Raises ValueError where the text is no event at all: no JSON object, or one without the
    fields that all events have."""
    try:
        return _KNOWN.validate_json(text, extra="ignore")
    except ValidationError:
        event = UnknownEvent.model_validate_json(text, extra="ignore")
    told = _with_cameras(event.model_dump()) | {"kind": RENAMED_KINDS.get(event.kind, event.kind)}
    try:
        return _KNOWN.validate_python(told, extra="ignore")
    except ValidationError:
        return event


def _with_cameras(value: Any) -> Any:
    """What version 0.1 recorded named a view by its heading alone, one of the default rig's."""
    if isinstance(value, list):
        return [_with_cameras(item) for item in value]
    if not isinstance(value, dict):
        return value
    known = {key: _with_cameras(item) for key, item in value.items()}
    if "heading_deg" in known and "camera" not in known:
        names = {camera.heading_deg: camera.name for camera in default_rig().cameras}
        known["camera"] = names.get(known["heading_deg"])
    return known


def json_schema() -> dict[str, Any]:
    """The JSON Schema (2020-12) of an event as it is written. It allows further fields: a newer writer may add some."""
    schema = _for_readers(_KNOWN.json_schema(mode="serialization"))
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "An event of a LogisticsVLN delivery",
        "description": "One line of events.jsonl, and the data of one message of /v1/deliveries/{id}/events.",
        **schema,
    }


def _for_readers(schema: Any) -> Any:
    """The same schema open for further fields, its descriptions without line breaks."""
    if isinstance(schema, list):
        return [_for_readers(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    return {
        key: " ".join(value.split()) if key == "description" and isinstance(value, str) else _for_readers(value)
        for key, value in schema.items()
        if key != "additionalProperties" or value is not False
    }


def schema_text() -> str:
    """`json_schema` as the text of a file."""
    return json.dumps(json_schema(), indent=1, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    sys.stdout.write(schema_text())
