"""The questions of recorded flights: what the mission asked about which pictures, and what it was told."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

import pybase64
from pydantic import Field

from contracts.base import ModelName, Wire
from contracts.cameras import Camera
from contracts.events import DirectionEvent, Event, FloorCountEvent, LookEvent, ParsedEvent
from contracts.geometry import PointLabel, Pose
from contracts.images import BadImage, JpegImage, jpeg_bytes
from contracts.orchestrator import DeliveryQuestion
from contracts.vlm_gateway import (
    Answer,
    ChooseDirectionAnswer,
    ChooseDirectionQuestion,
    FindObjectAnswer,
    FindObjectQuestion,
    FloorCountAnswer,
    FloorCountQuestion,
    MarkedPoint,
    Match,
    Outcome,
    View,
)
from mission.policies.points import search_task
from mission.record import BadRecord, read_events, read_question

Kind = Literal["find-object", "floor-count", "choose-direction"]
KINDS: tuple[Kind, ...] = ("find-object", "floor-count", "choose-direction")
Asked: TypeAlias = FindObjectQuestion | FloorCountQuestion | ChooseDirectionQuestion
Said: TypeAlias = FindObjectAnswer | FloorCountAnswer | ChooseDirectionAnswer


class NoQuestions(ValueError):
    """There is nothing to ask; the message says what would help."""


class Given(Wire):
    """One answer to one question, whoever gave it. `unreachable`: nobody answered, which says nothing of anybody."""

    question: str
    outcome: Outcome | Literal["unreachable"]
    found: bool | None = None
    matches: tuple[Match, ...] = ()
    floors: int | None = Field(default=None, ge=0, le=100)
    label: PointLabel | None = None
    latency_s: Annotated[float, Field(ge=0.0)] = 0.0
    cached: bool = False
    prompt_tokens: int = 0
    completion_tokens: int = 0


class RecordedQuestion(Wire):
    """`id`: the flight's folder and the event's number. `pictures` are files of the flight, one for each of `cameras`;
    `recorded` is what `recorded_by` answered in flight."""

    id: str
    kind: Kind
    folder: str
    pose: Pose | None
    cameras: tuple[Camera, ...] = Field(min_length=1)
    pictures: tuple[str, ...] = Field(min_length=1)
    object: str | None = None
    floor: int | None = None
    points: tuple[MarkedPoint, ...] = ()
    task: str | None = None
    recorded: Given
    recorded_by: str

    def jpeg(self, number: int) -> bytes:
        """Raises OSError."""
        return (Path(self.folder) / "pictures" / self.pictures[number]).read_bytes()

    def asked(self, model: ModelName) -> Asked:
        """As it is put to the gateway. Raises NoQuestions where a picture is missing or damaged."""
        images = [self._image(number) for number in range(len(self.pictures))]
        if self.kind == "find-object":
            views = tuple(View(camera=c, image=i) for c, i in zip(self.cameras, images, strict=True))
            return FindObjectQuestion(model=model, object=self.object or "", views=views)
        if self.kind == "floor-count":
            return FloorCountQuestion(model=model, image=images[0], camera=self.cameras[0])
        return ChooseDirectionQuestion(
            model=model, camera=self.cameras[0], image=images[0], points=self.points, task=self.task or ""
        )

    def _image(self, number: int) -> JpegImage:
        name = Path(self.folder) / "pictures" / self.pictures[number]
        try:
            image = JpegImage(jpeg_base64=pybase64.b64encode(self.jpeg(number)).decode("ascii"))
            jpeg_bytes(image)
        except OSError as error:
            raise NoQuestions(f"{name}: {error.strerror}") from None
        except (BadImage, ValueError) as error:
            raise NoQuestions(f"{name}: {error}") from None
        return image


def recorded_questions(places: Sequence[Path]) -> list[RecordedQuestion]:
    """Of runs whose pictures were kept, or of single records, in the order of their names. Raises NoQuestions."""
    folders = [folder for place in places for folder in _records(place)]
    names = [folder.name for folder in folders]
    found = []
    for folder in folders:
        name = folder.name if names.count(folder.name) == 1 else f"{folder.parent.parent.name}/{folder.name}"
        try:
            asked = read_question(folder)
        except (BadRecord, OSError) as error:
            raise NoQuestions(str(error)) from None
        events = read_events(folder)
        task = _search_task(asked, events)
        found += [q for event in events if (q := _question(name, folder, asked, task, event)) is not None]
    if not found:
        raise NoQuestions(f"nothing was asked about pictures in {', '.join(map(str, places))}")
    return found


def given(question: str, answer: Answer) -> Given:
    """An answer of the gateway, as it is kept."""
    content: dict[str, Any] = answer.model_dump(include={"outcome", "found", "matches", "floors", "label", "latency_s"})
    return Given(
        question=question,
        cached=answer.cache == "hit",
        prompt_tokens=answer.tokens.prompt,
        completion_tokens=answer.tokens.completion,
        **content,
    )


def _records(place: Path) -> list[Path]:
    if (place / "events.jsonl").is_file():
        return [place]
    found = sorted(path.parent for path in (place / "episodes").glob("*/events.jsonl"))
    if not found:
        raise NoQuestions(
            f"{place} is neither a record nor a run with pictures: fly one with `logisticsvln bench --pictures all`"
        )
    return found


def _search_task(asked: DeliveryQuestion, events: Sequence[Event]) -> str | None:
    """What the choice model was told; null where the request was not understood."""
    parsed = next((e.data.answer for e in reversed(events) if isinstance(e, ParsedEvent)), None)
    if parsed is None or parsed.object is None or parsed.floor is None:
        return None
    direction = asked.settings.viewpoint.constants.get("direction", "clockwise")
    return search_task(parsed.object, parsed.floor, str(direction))


def _question(
    name: str, folder: Path, asked: DeliveryQuestion, task: str | None, event: Event
) -> RecordedQuestion | None:
    common: dict[str, Any] = {"id": f"{name}/{event.number:04d}", "folder": str(folder)}
    if isinstance(event, LookEvent) and event.data.object:
        pictures = [event.picture(view.picture) for view in event.data.views]
        common |= {"kind": "find-object", "object": event.data.object, "pose": event.data.pose}
        return _made(common, tuple(view.camera for view in event.data.views), pictures, event.data.answer)
    front = asked.settings.rig_flown.front
    if isinstance(event, FloorCountEvent) and front is not None:
        common |= {"kind": "floor-count", "floor": event.data.floors_wanted, "pose": event.data.pose}
        return _made(common, (front,), event.pictures[:1], event.data.answer)
    if isinstance(event, DirectionEvent) and event.data.answer is not None and task is not None:
        return _direction(common | {"task": task}, asked, event, event.data.answer)
    return None


def _direction(
    common: dict[str, Any], asked: DeliveryQuestion, event: DirectionEvent, answer: ChooseDirectionAnswer
) -> RecordedQuestion | None:
    camera = next((c for c in asked.settings.rig_flown.cameras if c.name == event.data.camera), None)
    if camera is None:
        return None
    offered = [point for point in event.data.points if point.label in event.data.offered]
    points = tuple(MarkedPoint(label=p.label, x=p.x, y=p.y, distance_m=p.distance_m) for p in offered)
    common |= {"kind": "choose-direction", "points": points, "pose": None}
    return _made(common, (camera,), event.pictures[:1], answer)


def _made(
    common: dict[str, Any], cameras: tuple[Camera, ...], pictures: Sequence[str | None], answer: Said
) -> RecordedQuestion | None:
    """Null where the event names no picture of each camera."""
    if len(pictures) != len(cameras) or None in pictures:
        return None
    return RecordedQuestion(
        **common,
        cameras=cameras,
        pictures=pictures,
        recorded=given(common["id"], answer),
        recorded_by=answer.model,
    )


def by_flight(questions: Sequence[RecordedQuestion]) -> Iterator[list[RecordedQuestion]]:
    """Those of one flight together."""
    flights: dict[str, list[RecordedQuestion]] = {}
    for question in questions:
        flights.setdefault(question.folder, []).append(question)
    yield from flights.values()
