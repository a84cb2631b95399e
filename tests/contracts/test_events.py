"""Events: what is written reads back as it was, what is not known is kept, and the published schema is today's."""

import json
from pathlib import Path
from typing import get_args

import pytest
from pydantic import ValidationError

from contracts.event_data import EventData, LostData, MoveData, NoData, TurnData
from contracts.events import (
    Event,
    KnownEvent,
    LookEvent,
    LostEvent,
    MoveEvent,
    SearchEvent,
    TurnEvent,
    UnknownEvent,
    json_schema,
    new_event,
    read_event,
    schema_text,
)
from contracts.geometry import Point3, Pose
from contracts.orchestrator import DeliveryResult

ROOT = Path(__file__).parents[2]
FIRST_VERSION = ROOT / "tests" / "data" / "records" / "events-0.1.jsonl"
HERE, THERE = Pose(x=0.0, y=0.0, z=2.0, yaw=0.0), Pose(x=3.0, y=0.0, z=2.0, yaw=0.0)
LOST = LostData(place=Point3(x=1.0, y=2.0, z=3.0), blocked=True)


def event(data: EventData, number: int = 1) -> KnownEvent:
    return new_event(data, number=number, time_s=0.5, phase="approach", message="said", pictures=["0001_view.jpg"])


def move(kind: type[MoveData] = MoveData, *, reached: bool = True) -> MoveData:
    corner, end = Point3(x=2.0, y=1.0, z=2.0), Point3(x=3.0, y=0.0, z=2.0)
    return kind(
        number=1, start=HERE, to=THERE, path=(corner, end), reached=reached,
        collided=False, hit=None, path_m=3.0, flight_s=2.0,
    )  # fmt: skip


def changed(event: Event, **fields: object) -> str:
    return json.dumps(json.loads(event.model_dump_json()) | fields)


def test_an_event_is_written_with_its_kind_and_its_data_and_reads_back_as_it_was() -> None:
    written = event(LOST)
    assert json.loads(written.model_dump_json()) == {
        "number": 1,
        "time_s": 0.5,
        "phase": "approach",
        "kind": "lost",
        "message": "said",
        "data": {"place": {"x": 1.0, "y": 2.0, "z": 3.0}, "blocked": True},
        "pictures": ["0001_view.jpg"],
    }
    assert isinstance(written, LostEvent)
    assert read_event(written.model_dump_json()) == written


def test_a_move_starts_under_the_name_from_and_a_turn_is_told_from_it_by_its_kind() -> None:
    flown, turned = event(move()), event(move(TurnData))
    assert json.loads(flown.model_dump_json())["data"]["from"] == HERE.model_dump()
    assert isinstance(read_event(flown.model_dump_json()), MoveEvent)
    assert isinstance(read_event(turned.model_dump_json()), TurnEvent)


def test_a_move_that_was_stopped_early_names_no_corners() -> None:
    assert move().corners == (Point3(x=2.0, y=1.0, z=2.0),)
    assert move(reached=False).corners == ()


def test_every_kind_of_data_belongs_to_exactly_one_kind_of_event() -> None:
    kinds = {known.model_fields["data"].annotation: known for known in get_args(KnownEvent)}
    assert set(kinds) == set(get_args(EventData))
    assert len({known.model_fields["kind"].default for known in kinds.values()}) == len(get_args(KnownEvent))


def test_an_event_of_an_unknown_kind_is_kept_with_its_data() -> None:
    read = read_event(changed(event(LOST), kind="landed", data={"height_m": 0.0}))
    assert isinstance(read, UnknownEvent)
    assert (read.number, read.kind, read.message, read.data) == (1, "landed", "said", {"height_m": 0.0})


def test_a_field_that_a_newer_writer_added_anywhere_is_passed_over() -> None:
    document = json.loads(event(LOST).model_dump_json())
    document["seen_by"] = "two cameras"
    document["data"]["place"]["uncertainty_m"] = 0.2
    assert read_event(json.dumps(document)) == event(LOST)


@pytest.mark.parametrize("data", [{}, {"place": "here", "blocked": True}], ids=["without", "another shape"])
def test_data_of_another_shape_is_kept_as_an_unknown_event(data: dict[str, object]) -> None:
    read = read_event(changed(event(LOST), data=data))
    assert isinstance(read, UnknownEvent)
    assert (read.kind, read.data) == ("lost", data)


def test_a_phase_that_is_not_known_here_does_not_end_the_reading() -> None:
    assert read_event(changed(event(NoData()), phase="charging")).phase == "charging"


@pytest.mark.parametrize("text", ["", "[]", '{"number":2,"time_s":1.0,"pha', '{"number":2,"kind":"lost"}'])
def test_what_is_no_event_at_all_is_refused(text: str) -> None:
    with pytest.raises(ValidationError):
        read_event(text)


def test_data_of_the_wrong_kind_is_refused_where_it_is_written() -> None:
    with pytest.raises(ValidationError, match="data"):
        LostEvent(number=1, time_s=0.0, phase="approach", message="", data={"place": None, "blocked": True})


def test_the_events_of_the_first_version_still_read() -> None:
    read = [read_event(line) for line in FIRST_VERSION.read_text(encoding="utf-8").splitlines()]
    assert {e.kind for e in read} >= {"parsed", "placed", "floor_count", "look", "direction", "search", "result"}
    unknown = {e.kind for e in read if isinstance(e, UnknownEvent)}
    assert unknown == set()
    searched = next(e for e in read if isinstance(e, SearchEvent))
    assert searched.data.drawing is not None
    assert searched.data.drawing.inspected
    assert searched.data.inspected_share is not None
    look = next(e for e in read if isinstance(e, LookEvent))
    assert [view.camera.heading_deg for view in look.data.views] == [-90.0, -45.0, 0.0, 45.0, 90.0]
    assert all(look.picture(view.picture) for view in look.data.views)


def test_the_published_schema_is_that_of_todays_events() -> None:
    published = (ROOT / "docs" / "events.schema.json").read_text(encoding="utf-8")
    assert published == schema_text(), "write it anew: make schema"


def test_the_schema_lets_a_reader_tell_the_kinds_apart_and_allows_fields_of_newer_writers() -> None:
    schema = json_schema()
    kinds = set(schema["discriminator"]["mapping"])
    assert kinds == {known.model_fields["kind"].default for known in get_args(KnownEvent)}
    assert '"additionalProperties": false' not in schema_text()


def test_a_result_of_version_0_2_that_nobody_judged_is_read_as_a_stop() -> None:
    told = {"outcome": "delivered_not_judged", "message": "", "steps": 1, "exploration_steps": 0, "renderer": None}
    told |= dict.fromkeys(("path_m", "path_horizontal_m", "flight_s"), 0.0) | {"timings_s": {}, "model_calls": {}}
    told |= dict.fromkeys(("floor", "object", "final_height_m", "pose", "verdict"))
    assert DeliveryResult.model_validate(told).outcome == "stopped_not_judged"
