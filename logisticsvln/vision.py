"""A vision back end from a plain class or function: what it does not answer itself, a model of the gateway answers.

```python
def find(views, phrase):                      # on its own it answers `find_object`
    return [Match(camera="front", box=Box(...), confidence=0.9)]

class Mine:                                   # any of the four questions, plain or with `async def`
    def count_floors(self, picture): ...      # -> int, or None: unreadable
    def find_building(self, picture): ...     # -> Box; NOTHING: none is there; None: unreadable
    def find_object(self, views, phrase): ... # -> list of Match, empty where it is not seen; None: unreadable
    def choose_direction(self, picture, points, task): ...   # -> the label of one of the points; None: unreadable
```
"""

import time
from collections.abc import Sequence
from enum import Enum
from functools import cached_property
from numbers import Integral
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from contracts.base import Unit
from contracts.cameras import Camera
from contracts.geometry import Box
from contracts.images import JpegImage, decode_jpeg, jpeg_bytes
from contracts.vlm_gateway import (
    BuildingBoxAnswer,
    BuildingBoxQuestion,
    ChooseDirectionAnswer,
    ChooseDirectionQuestion,
    FindObjectAnswer,
    FindObjectQuestion,
    FloorCountAnswer,
    FloorCountQuestion,
    Match,
    PreflightAnswer,
    PreflightQuestion,
)
from logisticsvln.functions import call, must_take
from mission.ports import Vision
from orchestrator.delivery import BadDelivery

BACKEND = "python"
"""What answers of one's own code are recorded as."""
QUESTIONS = {
    "count_floors": ("picture",),
    "find_building": ("picture",),
    "find_object": ("views", "phrase"),
    "choose_direction": ("picture", "points", "task"),
}
"""What may be asked, and with what."""


class Nothing(Enum):
    """The type of `NOTHING`."""

    NOTHING = "nothing"


NOTHING: Final = Nothing.NOTHING
"""A model's answer that no building is there; "can't say" is None."""


class CameraPicture:
    """One camera's picture; `camera` is None where the asker does not say what took it."""

    def __init__(self, camera: Camera | None, image: JpegImage) -> None:
        self.camera = camera
        self._image = image

    @cached_property
    def jpeg(self) -> bytes:
        """The JPEG file."""
        return jpeg_bytes(self._image)

    @cached_property
    def rgb(self) -> NDArray[np.uint8]:
        """(H, W, 3) uint8."""
        return decode_jpeg(self._image)


class OwnVision:
    """One's own model before the eyes of a mission."""

    def __init__(
        self, model: object, *, name: str | None = None, rest: str | None = None, claim_confidence: Unit | None = None
    ) -> None:
        """Takes the model as it is.

        Args:
            model: An object with any of the methods `count_floors`, `find_building`, `find_object`,
                `choose_direction`, or a function that is its `find_object`.
            name: What its answers are recorded as; its own name without it.
            rest: Who answers the other questions: `embedded`, `oracle`, or an alias of the gateway's configuration;
                whom the gateway's roles name without it.
            claim_confidence: From which a match may be claimed; below it is a candidate, worth a nearer look. None:
                the model names only what it is sure of.

        Raises:
            BadDelivery: For a model that answers none of the questions, or takes other arguments.
        """
        self._methods = {question: getattr(model, question, None) for question in QUESTIONS}
        if callable(model) and not any(self._methods.values()):
            self._methods["find_object"] = model
        if not any(self._methods.values()):
            raise BadDelivery(
                f"vision: give a model's name, a function of (views, phrase), or an object with one of "
                f"{', '.join(QUESTIONS)}; {type(model).__name__} has none of them"
            )
        for question, method in self._methods.items():
            if method is not None:
                must_take(method, QUESTIONS[question], f"vision: {question}")
        self._known = getattr(model, "preflight", None)
        self.name: str = name or getattr(model, "__name__", type(model).__name__).strip("<>_")
        self.rest = rest
        self.claim_confidence = claim_confidence

    @property
    def asks_others(self) -> bool:
        """Is there a question that it leaves to the gateway?"""
        return not all(self._methods.values())

    def before(self, gateway: Vision) -> "VisionPort":
        """As a mission's port; `gateway` is asked what this model does not answer."""
        return VisionPort(self, gateway)

    def method(self, question: str) -> Any:
        """The model's method for a question; None where it has none."""
        return self._methods[question]

    @property
    def knows(self) -> Any:
        """The model's `preflight(phrase)`: why it can't recognise the thing, None where it can."""
        return self._known


Model: TypeAlias = str | OwnVision | object
"""Who sees: a model's name, or one's own object or function."""


class VisionPort:
    """`mission.ports.Vision` of an own model. What the model itself raises is not caught."""

    def __init__(self, own: OwnVision, gateway: Vision) -> None:
        self._own = own
        self._gateway = gateway

    async def preflight(self, question: PreflightQuestion) -> PreflightAnswer:
        if question.object is None or self._own.method("find_object") is None:
            return await self._gateway.preflight(self._passed_on(question))
        why = await call(self._own.knows, question.object) if self._own.knows is not None else None
        return PreflightAnswer(
            model=self._own.name, backend=BACKEND, known=why is None, why=None if why is None else str(why)
        )

    async def floor_count(self, question: FloorCountQuestion) -> FloorCountAnswer:
        method = self._own.method("count_floors")
        if method is None:
            return await self._gateway.floor_count(self._passed_on(question))
        began = time.perf_counter()
        said = await call(method, CameraPicture(question.camera, question.image))
        told = self._told("floors", said, began)
        return FloorCountAnswer(
            **told, floors=None if said is None else int(_typed(said, Integral, "count_floors", "a whole number"))
        )

    async def building_box(self, question: BuildingBoxQuestion) -> BuildingBoxAnswer:
        method = self._own.method("find_building")
        if method is None:
            return await self._gateway.building_box(self._passed_on(question))
        began = time.perf_counter()
        said = await call(method, CameraPicture(question.camera, question.image))
        told = self._told("floors", said, began)
        none = said is None or said is NOTHING
        return BuildingBoxAnswer(**told, box=None if none else _typed(said, Box, "find_building", "a Box"))

    async def find_object(self, question: FindObjectQuestion) -> FindObjectAnswer:
        method = self._own.method("find_object")
        if method is None:
            return await self._gateway.find_object(self._passed_on(question))
        began = time.perf_counter()
        views = tuple(CameraPicture(view.camera, view.image) for view in question.views)
        said = await call(method, views, question.object)
        told = self._told("recognition", said, began)
        if said is None:
            return FindObjectAnswer(**told)
        matches = self._matches(said, [view.camera.name for view in question.views])
        least = self._own.claim_confidence
        found = any(least is None or match.confidence >= least for match in matches)
        return FindObjectAnswer(**told, found=found, matches=matches, claim_confidence=least)

    async def choose_direction(self, question: ChooseDirectionQuestion) -> ChooseDirectionAnswer:
        method = self._own.method("choose_direction")
        if method is None:
            return await self._gateway.choose_direction(self._passed_on(question))
        began = time.perf_counter()
        picture = CameraPicture(question.camera, question.image)
        said = await call(method, picture, question.points, question.task)
        told = self._told("choice", said, began)
        labels = [point.label for point in question.points]
        if said is not None and said not in labels:
            raise ValueError(f"choose_direction: say one of {', '.join(labels)}, or None, not {said!r}")
        return ChooseDirectionAnswer(**told, label=said)

    def _matches(self, said: object, cameras: Sequence[str]) -> tuple[Match, ...]:
        """The most confident first. Raises TypeError, ValueError for what are no matches in these views."""
        listed = _typed(said, list | tuple, "find_object", "a list of Match")
        matches = tuple(_typed(one, Match, "find_object", "a list of Match") for one in listed)
        for match in matches:
            if match.camera not in cameras:
                raise ValueError(f"find_object: no view is called {match.camera!r}; there are {', '.join(cameras)}")
        return tuple(sorted(matches, key=lambda match: -match.confidence))

    def _told(self, role: str, said: object, began: float) -> dict[str, Any]:
        """What every answer carries."""
        return {
            "outcome": "unreadable" if said is None else "answered",
            "role": role,
            "backend": BACKEND,
            "model": self._own.name,
            "latency_s": time.perf_counter() - began,
        }

    def _passed_on(self, question: Any) -> Any:
        """The same question for the model that answers the rest."""
        return question.model_copy(update={"model": self._own.rest})


def _typed(said: Any, kind: Any, method: str, right: str) -> Any:
    if not isinstance(said, kind) or isinstance(said, bool):
        raise TypeError(f"{method}: say {right}, or None where it can't be said, not {said!r}")
    return said
