"""The four typed questions: what each asks of a back end and how its reply becomes an answer."""

from collections.abc import Awaitable, Callable
from typing import Any, NamedTuple

from contracts.cameras import Camera
from contracts.vlm_gateway import (
    Answer,
    BuildingBoxAnswer,
    BuildingBoxQuestion,
    ChooseDirectionAnswer,
    ChooseDirectionQuestion,
    FindObjectAnswer,
    FindObjectQuestion,
    FloorCountAnswer,
    FloorCountQuestion,
    Question,
    Role,
)
from service_kit.errors import BadQuestion
from services.vlm_gateway.backends.base import (
    AskedView,
    Backend,
    Building,
    BuildingAsk,
    Direction,
    DirectionAsk,
    Floors,
    FloorsAsk,
    ObjectAsk,
    Picture,
    Reply,
    Sightings,
)
from services.vlm_gateway.pictures import picture_of


class Prepared(NamedTuple):
    """A question with its pictures checked: `words` and `pictures` are all of it that an answer may depend on."""

    words: dict[str, object]
    pictures: tuple[Picture, ...]
    ask: Callable[[Backend], Awaitable[Reply[Any]]]


class Kind(NamedTuple):
    """A typed question, at `POST /v1/<path>`. `fields` are the content of an answered reply in the answer's words;
    `about` is one sentence for the API's description."""

    path: str
    about: str
    role: Role
    question: type[Question]
    answer: type[Answer]
    prepare: Callable[[Any], Prepared]
    fields: Callable[[Any], dict[str, object]]


def _floors(question: FloorCountQuestion) -> Prepared:
    picture = picture_of(question.image)
    ask = FloorsAsk(picture, question.camera)
    return Prepared(_taken_by(question.camera), (picture,), lambda backend: backend.count_floors(ask))


def _building(question: BuildingBoxQuestion) -> Prepared:
    picture = picture_of(question.image)
    ask = BuildingAsk(picture, question.camera)
    return Prepared(_taken_by(question.camera), (picture,), lambda backend: backend.find_building(ask))


def _object(question: FindObjectQuestion) -> Prepared:
    names = [view.camera.name for view in question.views]
    if len(set(names)) != len(names):
        raise BadQuestion(f"views: each camera's name may be given once, not {', '.join(names)}")
    views = tuple(AskedView(view.camera, picture_of(view.image)) for view in question.views)
    ask = ObjectAsk(question.object, views)
    words: dict[str, object] = {
        "object": question.object,
        "cameras": [view.camera.model_dump() for view in question.views],
    }
    return Prepared(words, tuple(view.picture for view in views), lambda backend: backend.find_object(ask))


def _direction(question: ChooseDirectionQuestion) -> Prepared:
    labels = [point.label for point in question.points]
    if len(set(labels)) != len(labels):
        raise BadQuestion("points: each label may be given once")
    picture = picture_of(question.image)
    ask = DirectionAsk(question.camera, picture, question.points, question.task)
    words: dict[str, object] = {
        "camera": question.camera.model_dump(),
        "points": [point.model_dump() for point in question.points],
        "task": question.task,
    }
    return Prepared(words, (picture,), lambda backend: backend.choose_direction(ask))


def _taken_by(camera: Camera | None) -> dict[str, object]:
    return {"camera": None if camera is None else camera.model_dump()}


def _floors_fields(content: Floors | None) -> dict[str, object]:
    return {} if content is None else {"floors": content.count, "rows": content.rows}


def _building_fields(content: Building | None) -> dict[str, object]:
    return {} if content is None else {"box": content.box}


def _object_fields(content: Sightings | None) -> dict[str, object]:
    if content is None:
        return {}
    found = any(match.confidence >= (content.claim or 0.0) for match in content.matches)
    return {"found": found, "matches": content.matches, "claim_confidence": content.claim}


def _direction_fields(content: Direction | None) -> dict[str, object]:
    return {} if content is None else {"label": content.label}


KINDS: tuple[Kind, ...] = (
    Kind(
        path="floor-count",
        about="How many floors are visible in the picture?",
        role="floors",
        question=FloorCountQuestion,
        answer=FloorCountAnswer,
        prepare=_floors,
        fields=_floors_fields,
    ),
    Kind(
        path="building-box",
        about="Where in the picture is the building?",
        role="floors",
        question=BuildingBoxQuestion,
        answer=BuildingBoxAnswer,
        prepare=_building,
        fields=_building_fields,
    ),
    Kind(
        path="find-object",
        about="In which of the views is the object visible, and where?",
        role="recognition",
        question=FindObjectQuestion,
        answer=FindObjectAnswer,
        prepare=_object,
        fields=_object_fields,
    ),
    Kind(
        path="choose-direction",
        about="Towards which of the marked points should the drone fly?",
        role="choice",
        question=ChooseDirectionQuestion,
        answer=ChooseDirectionAnswer,
        prepare=_direction,
        fields=_direction_fields,
    ),
)
