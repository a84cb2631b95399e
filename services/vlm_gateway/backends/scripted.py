"""A model that says what a script tells it to: for tests, demonstrations and replays by hand.

The script is a JSON object with a list per question; each entry is what one call brings, in the contract's words:

```json
{
  "floor-count": [{"floors": 3, "rows": [0.2, 0.5, 0.8]}, {"outcome": "refused", "text": "I can't tell."}],
  "building-box": [{"box": {"x_min": 0.1, "y_min": 0.0, "x_max": 0.9, "y_max": 1.0}}],
  "find-object": [{"matches": []}, {"error": "model_timeout"}],
  "choose-direction": [{"label": "d", "delay_s": 0.5}]
}
```
"""

import asyncio
from pathlib import Path
from typing import Literal, TypeVar

from pydantic import Field, ValidationError

from contracts.base import Unit, Wire
from contracts.errors import first_problem
from contracts.geometry import Box, PointLabel
from contracts.vlm_gateway import Match, Outcome, Tokens
from service_kit.errors import ServiceError
from service_kit.settings import BadSetting
from services.vlm_gateway.backends.base import (
    Building,
    BuildingAsk,
    Direction,
    DirectionAsk,
    Floors,
    FloorsAsk,
    Kind,
    ObjectAsk,
    Reply,
    Sightings,
)
from services.vlm_gateway.errors import ModelOverloaded, ModelTimeout, ModelUnreachable, ScriptEnded

L = TypeVar("L", bound="Line")


class Line(Wire):
    """One call's result. `error` stands for no answer at all."""

    outcome: Outcome = "answered"
    text: str | None = Field(default=None, max_length=20_000)
    tokens: Tokens = Tokens()
    delay_s: float = Field(default=0.0, ge=0.0, le=600.0)
    error: Literal["model_unreachable", "model_timeout", "model_overloaded"] | None = None


class FloorsLine(Line):
    floors: int = Field(default=0, ge=0, le=100)
    rows: tuple[Unit, ...] | None = None


class BuildingLine(Line):
    box: Box | None = None


class ObjectLine(Line):
    matches: tuple[Match, ...] = Field(default=(), max_length=25)


class DirectionLine(Line):
    label: PointLabel = "c"


class Script(Wire):
    """Entries per question, in the order of the calls."""

    floor_count: tuple[FloorsLine, ...] = Field(default=(), alias="floor-count")
    building_box: tuple[BuildingLine, ...] = Field(default=(), alias="building-box")
    find_object: tuple[ObjectLine, ...] = Field(default=(), alias="find-object")
    choose_direction: tuple[DirectionLine, ...] = Field(default=(), alias="choose-direction")


def load_script(path: Path) -> Script:
    """Raises BadSetting naming file and place."""
    try:
        return Script.model_validate_json(path.read_bytes())
    except OSError as error:
        raise BadSetting(f"script {path}: {error.strerror}; name a readable JSON file") from None
    except ValidationError as error:
        raise BadSetting(f"script {path}: {first_problem(error)}") from None


class ScriptedBackend:
    """Walks through `script`, each question's list on its own; with `repeat` it starts again at the end, without it
    the end is an error."""

    kind: Kind = "scripted"
    cacheable = False  # the next entry is the next answer, whatever was asked before

    def __init__(self, script: Script, *, name: str = "scripted", repeat: bool = False) -> None:
        self._script = script
        self._name = name
        self._repeat = repeat
        self._said = dict.fromkeys(("floor-count", "building-box", "find-object", "choose-direction"), 0)

    @property
    def model(self) -> str:
        return self._name

    @property
    def fingerprint(self) -> dict[str, object]:
        return {}

    async def preflight(self, phrase: str | None) -> str | None:
        return None

    async def count_floors(self, ask: FloorsAsk) -> Reply[Floors]:
        line = await self._next("floor-count", self._script.floor_count)
        return _reply(line, Floors(line.floors, line.rows))

    async def find_building(self, ask: BuildingAsk) -> Reply[Building]:
        line = await self._next("building-box", self._script.building_box)
        return _reply(line, Building(line.box))

    async def find_object(self, ask: ObjectAsk) -> Reply[Sightings]:
        line = await self._next("find-object", self._script.find_object)
        return _reply(line, Sightings(line.matches))

    async def choose_direction(self, ask: DirectionAsk) -> Reply[Direction]:
        line = await self._next("choose-direction", self._script.choose_direction)
        return _reply(line, Direction(line.label))

    def status(self) -> dict[str, object]:
        return {"said": dict(self._said)}

    async def close(self) -> None:
        return

    async def _next(self, question: str, lines: tuple[L, ...]) -> L:
        at = self._said[question]
        if at >= len(lines) and not (self._repeat and lines):
            raise ScriptEnded(f"the script of {self._name!r} has {len(lines)} answers for {question}; all are said")
        self._said[question] = at + 1
        line = lines[at % len(lines)]
        if line.delay_s:
            await asyncio.sleep(line.delay_s)
        if line.error:
            raise _error(line.error)
        return line


C = TypeVar("C")


def _reply(line: Line, content: C) -> Reply[C]:
    if line.outcome != "answered":
        return Reply(line.outcome, None, line.text, line.tokens)
    return Reply("answered", content, line.text, line.tokens)


def _error(code: str) -> ServiceError:
    words = "the script says so"
    if code == "model_timeout":
        return ModelTimeout(words)
    return ModelOverloaded(words) if code == "model_overloaded" else ModelUnreachable(words)
