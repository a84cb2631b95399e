"""vlm_gateway: the four typed vision questions, and the question before take-off whether they can be asked.

Three different things can go wrong and are never mixed: the model says no (`answered`, with `found` false or a null
box), its answer can't be read (`unreadable`, or `refused` where it declined), or it can't be reached (an error with
code `model_unreachable`, `model_timeout`, `model_overloaded` or `model_rejected`, or `not_recorded` in replay mode; no
answer at all). That the oracle's simulator does not answer is a service's error, `unavailable`.
"""

from typing import Literal

from pydantic import ConfigDict, Field

from contracts.base import Metres, ModelName, Name, Unit, Wire
from contracts.cameras import MAX_CAMERAS, Camera
from contracts.geometry import Box, PointLabel
from contracts.images import JpegImage

Role = Literal["parser", "floors", "recognition", "choice"]
Outcome = Literal["answered", "unreadable", "refused"]
MAX_MATCHES = 25
CacheResult = Literal["hit", "miss", "off"]
BackendKind = Name
"""`embedded`, `chat`, `oracle`, `scripted`, or the name under which another package brings its back end."""


ORACLE_VEHICLE_HEADER = "x-oracle-vehicle"
"""The HTTP header by which whoever runs the oracle names the simulator's vehicle that took the pictures. Only the
`oracle` back end reads it; no other model and no cache ever sees it."""


class Question(Wire):
    """`model` names an alias of the gateway's configuration; without it the role's default answers."""

    model: ModelName | None = None


class ListedModel(Wire):
    """A model as `GET /v1/models` lists it, as far as our own programs read it. `roles`: those that it answers where
    nobody names a model."""

    model_config = ConfigDict(extra="ignore")

    id: ModelName
    owned_by: BackendKind
    roles: tuple[Role, ...] = ()


class ModelList(Wire):
    model_config = ConfigDict(extra="ignore")

    data: tuple[ListedModel, ...]


class PreflightQuestion(Wire):
    """Before take-off: is there such a model, does it take pictures, and can it recognise this object? `object` is a
    noun phrase; null asks about the model alone. The model is not run. An unknown model is the error `unknown_model`,
    whose details name the models there are."""

    model: ModelName | None = None
    object: str | None = Field(default=None, min_length=1, max_length=200)


class PreflightAnswer(Wire):
    """`known` is false where the model has never learnt to see such an object, with the reason in `why`; a model
    without a fixed vocabulary knows every object. Null where no object was asked about."""

    model: str
    backend: BackendKind
    known: bool | None = None
    why: str | None = Field(default=None, max_length=1000)


class Tokens(Wire):
    prompt: int = Field(default=0, ge=0)
    completion: int = Field(default=0, ge=0)


class Answer(Wire):
    """What every answer carries beside its content. `text` is the model's own words, where it has any. `usd`: what this
    call cost, US dollars, by the prices of the gateway's configuration; null where it has none for the model, where
    the model's server counts no tokens, and for an answer from the cache."""

    outcome: Outcome
    role: Role
    backend: BackendKind
    model: str
    cache: CacheResult = "off"
    latency_s: float = Field(default=0.0, ge=0.0)
    attempts: int = Field(default=1, ge=0)
    tokens: Tokens = Tokens()
    usd: float | None = Field(default=None, ge=0.0)
    text: str | None = Field(default=None, max_length=20_000)


class View(Wire):
    """One camera's picture. The camera's heading and pitch say where it looked, relative to the drone's nose."""

    camera: Camera
    image: JpegImage


class FloorCountQuestion(Question):
    """How many floors of the building ahead are visible? A floor counts when the middle of its row of windows lies
    inside the picture. `camera`: what took the picture; without it the picture is taken as it is."""

    image: JpegImage
    camera: Camera | None = None


class FloorCountAnswer(Answer):
    """`rows` are the heights of the visible floors' window rows, 0..1 from the top, topmost first, where the model
    gives them."""

    floors: int | None = Field(default=None, ge=0, le=100)
    rows: tuple[Unit, ...] | None = Field(default=None, max_length=100)


class BuildingBoxQuestion(Question):
    """Where in the picture is the building straight ahead? `camera`: what took the picture; without it the picture is
    taken as it is."""

    image: JpegImage
    camera: Camera | None = None


class BuildingBoxAnswer(Answer):
    """`box` is null when the model sees no building."""

    box: Box | None = None


class FindObjectQuestion(Question):
    """Is this object visible in any of the views, and where? `object` is a noun phrase. The views' cameras have names
    of their own."""

    object: str = Field(min_length=1, max_length=200)
    views: tuple[View, ...] = Field(min_length=1, max_length=MAX_CAMERAS)


class Match(Wire):
    """One place where the model sees the object, by the camera's name; `confidence` is 1 where a model gives none."""

    camera: Name
    box: Box
    confidence: Unit = 1.0


class FindObjectAnswer(Answer):
    """`found` is null unless the outcome is `answered`; `matches` are the most confident first. From
    `claim_confidence` on a match may be claimed as it stands; one below is a candidate, worth another look from nearer.
    Null: the model names only what it is sure of. `found` says that some match may be claimed."""

    found: bool | None = None
    matches: tuple[Match, ...] = Field(default=(), max_length=MAX_MATCHES)
    claim_confidence: Unit | None = None


class MarkedPoint(Wire):
    """One of the points marked in the picture, at (x, y) of its width and height, and how far one may safely fly
    towards it."""

    label: PointLabel
    x: Unit
    y: Unit
    distance_m: Metres


class ChooseDirectionQuestion(Question):
    """Towards which of the marked points should the drone fly to go on searching round the building? `image` already
    carries the marks; `camera` took it."""

    camera: Camera
    image: JpegImage
    points: tuple[MarkedPoint, ...] = Field(min_length=1, max_length=5)
    task: str = Field(min_length=1, max_length=1000)


class ChooseDirectionAnswer(Answer):
    label: PointLabel | None = None
