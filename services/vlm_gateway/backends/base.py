"""What a back end is: the four questions, asked with checked pictures, answered with typed outcomes.

`tests/agreements/test_backends.py` is its contract. A back end raises a ServiceError where no answer came at all;
"no", "unreadable" and "refused" are replies.
"""

from contextvars import ContextVar
from dataclasses import dataclass
from typing import Generic, NamedTuple, Protocol, TypeVar

from contracts.cameras import Camera
from contracts.geometry import Box, PointLabel
from contracts.vlm_gateway import BackendKind, MarkedPoint, Match, Outcome, Tokens

T = TypeVar("T")
Kind = BackendKind
MAX_TEXT = 20_000
NO_TOKENS = Tokens()
asked_vehicle: ContextVar[str | None] = ContextVar("asked_vehicle", default=None)
"""Whose pictures the question being answered is about; set where the question comes in, read by the oracle alone."""


class Picture(NamedTuple):
    """A JPEG file whose header was read and found within bounds; its pixels are not decoded yet."""

    jpeg: bytes
    width: int
    height: int


@dataclass(frozen=True, slots=True)
class FloorsAsk:
    """`camera` is None where the asker does not say what took the picture."""

    picture: Picture
    camera: Camera | None


@dataclass(frozen=True, slots=True)
class BuildingAsk:
    """`camera` is None where the asker does not say what took the picture."""

    picture: Picture
    camera: Camera | None


class AskedView(NamedTuple):
    camera: Camera
    picture: Picture


@dataclass(frozen=True, slots=True)
class ObjectAsk:
    """`phrase` is a noun phrase."""

    phrase: str
    views: tuple[AskedView, ...]


@dataclass(frozen=True, slots=True)
class DirectionAsk:
    camera: Camera
    picture: Picture
    points: tuple[MarkedPoint, ...]
    task: str


@dataclass(frozen=True, slots=True)
class Floors:
    """`rows`: heights of the window rows, 0..1 from the top, topmost first; None where the model gives none."""

    count: int
    rows: tuple[float, ...] | None


class Building(NamedTuple):
    """`box` is None where no building is seen."""

    box: Box | None


class Sightings(NamedTuple):
    """Empty where the object is not seen; else the most confident first. `claim`: the confidence from which a match may
    be claimed, None for a model that only names what it is sure of."""

    matches: tuple[Match, ...]
    claim: float | None = None


class Direction(NamedTuple):
    label: PointLabel


@dataclass(frozen=True, slots=True)
class Reply(Generic[T]):
    """`content` is there exactly when the outcome is `answered`. `text` is the model's own words."""

    outcome: Outcome
    content: T | None = None
    text: str | None = None
    tokens: Tokens = NO_TOKENS
    attempts: int = 1

    def __post_init__(self) -> None:
        if (self.outcome == "answered") != (self.content is not None):
            raise ValueError("a reply has content exactly when it is answered")


class Backend(Protocol):
    """`fingerprint` is everything beside the question that an answer depends on; it goes into the cache's key.
    `cacheable` is false where the same question may rightly be answered differently the next time."""

    @property
    def kind(self) -> Kind: ...

    @property
    def model(self) -> str: ...

    @property
    def cacheable(self) -> bool: ...

    @property
    def fingerprint(self) -> dict[str, object]: ...

    async def preflight(self, phrase: str | None) -> str | None:
        """Before a mission, without running the model: why it can't recognise what the noun phrase names; None where it
        can, and without a phrase. Raises BadQuestion where it can't be asked about pictures at all."""
        ...

    async def count_floors(self, ask: FloorsAsk) -> Reply[Floors]: ...

    async def find_building(self, ask: BuildingAsk) -> Reply[Building]: ...

    async def find_object(self, ask: ObjectAsk) -> Reply[Sightings]: ...

    async def choose_direction(self, ask: DirectionAsk) -> Reply[Direction]: ...

    def status(self) -> dict[str, object]:
        """What an operator wants to see; no secrets."""

    async def close(self) -> None: ...


def shortened(text: str | None) -> str | None:
    """The model's words as an answer may carry them."""
    return text if text is None or len(text) <= MAX_TEXT else text[: MAX_TEXT - 1] + "…"
