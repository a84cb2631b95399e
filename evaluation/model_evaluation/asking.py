"""Asks the gateway about rendered pictures, as a mission would, and keeps every answer."""

from collections.abc import Awaitable, Callable, Sequence
from pathlib import Path
from typing import TypeVar

import pybase64

from contracts.base import ModelName, Unit, Wire
from contracts.cameras import default_rig
from contracts.geometry import Box
from contracts.images import JpegImage
from contracts.sim import Catalogue
from contracts.vlm_gateway import (
    Answer,
    BuildingBoxQuestion,
    FindObjectQuestion,
    FloorCountQuestion,
    Match,
    Outcome,
    View,
)
from evaluation.model_evaluation.cases import Case, Front, RenderedLook
from evaluation.model_evaluation.questions import Role, questions
from mission.ports import ModelUnreachable, Vision

A = TypeVar("A", bound=Answer)

FRONT = default_rig().camera("front")


class Sought(Wire):
    """One question for an object and its answer. `first`: the pictures of this look had not been shown to the model
    before."""

    seed: int
    look: int
    role: Role
    phrase: str
    kind: str | None
    colour: str | None
    first: bool
    outcome: Outcome
    matches: tuple[Match, ...] = ()
    claim_confidence: float | None = None
    latency_s: float = 0.0


class Counted(Wire):
    """One count of floors and the building's box in the same picture; null where no readable answer came. `rows`: where
    the model says their windows are, as in contracts.vlm_gateway.FloorCountAnswer."""

    seed: int
    front: int
    floors: int | None
    rows: tuple[Unit, ...] | None = None
    box: Box | None
    latency_s: float = 0.0


class Answers(Wire):
    """Everything one model said. `model`: who answered, by its own account. `unreachable`: questions at which it was
    out of reach; they are not among the others, nor are the other counts of floors of such a street."""

    model: str | None
    sought: tuple[Sought, ...]
    counted: tuple[Counted, ...]
    unreachable: int = 0


class Asker:
    """Asks one model. Raises mission.ports.PortError where the gateway itself fails, OSError."""

    def __init__(self, vision: Vision, folder: Path, catalogue: Catalogue, model: ModelName | None) -> None:
        self._vision = vision
        self._folder = folder
        self._catalogue = catalogue
        self._alias = model
        self.model: str | None = None
        self._unreachable = 0

    async def ask(self, cases: Sequence[Case], told: Callable[[int], None] | None = None) -> Answers:
        """`told` hears how many cases are done."""
        sought: list[Sought] = []
        counted: list[Counted] = []
        for done, case in enumerate(cases, 1):
            for number, look in enumerate(case.looks):
                sought += await self._look(case, number, look)
            try:
                counted += [await self._front(case, number, front) for number, front in enumerate(case.fronts)]
            except ModelUnreachable:  # floors are judged band after band: a street with a gap can't be
                self._unreachable += 1
            if told is not None:
                told(done)
        return Answers(model=self.model, sought=tuple(sought), counted=tuple(counted), unreachable=self._unreachable)

    async def _look(self, case: Case, number: int, look: RenderedLook) -> list[Sought]:
        views = tuple(
            View(camera=camera, image=self._picture(name))
            for camera, name in zip(look.cameras, look.pictures, strict=True)
        )
        sought = []
        for place, asked in enumerate(questions(case, number, self._catalogue)):
            question = FindObjectQuestion(model=self._alias, object=asked.phrase, views=views)
            try:
                answer = await self._answer(self._vision.find_object(question))
            except ModelUnreachable:
                self._unreachable += 1
                continue
            sought.append(
                Sought(
                    seed=case.seed,
                    look=number,
                    role=asked.role,
                    phrase=asked.phrase,
                    kind=asked.thing.kind if asked.thing else None,
                    colour=asked.thing.colour if asked.thing else None,
                    first=place == 0,
                    outcome=answer.outcome,
                    matches=answer.matches,
                    claim_confidence=answer.claim_confidence,
                    latency_s=answer.latency_s,
                )
            )
        return sought

    async def _front(self, case: Case, number: int, front: Front) -> Counted:
        image = self._picture(front.picture)
        count = await self._answer(
            self._vision.floor_count(FloorCountQuestion(model=self._alias, image=image, camera=FRONT))
        )
        building = await self._answer(
            self._vision.building_box(BuildingBoxQuestion(model=self._alias, image=image, camera=FRONT))
        )
        return Counted(
            seed=case.seed,
            front=number,
            floors=count.floors,
            rows=count.rows,
            box=building.box,
            latency_s=count.latency_s,
        )

    async def _answer(self, call: Awaitable[A]) -> A:
        answer = await call
        self.model = answer.model
        return answer

    def _picture(self, name: str) -> JpegImage:
        data = (self._folder / name).read_bytes()
        return JpegImage(jpeg_base64=pybase64.b64encode(data).decode("ascii"))
