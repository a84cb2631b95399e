"""Asks one role its questions about a task; and from all the answers, its figures."""

import contextlib
import zlib
from collections.abc import Awaitable, Iterator, Sequence
from contextlib import contextmanager
from typing import NamedTuple, TypeVar

import numpy as np

from contracts.base import ModelName, Name, Wire
from contracts.cameras import Camera
from contracts.depth_assist import (
    DirectionPoint,
    SafeDistancesQuestion,
    ViewDepth,
)
from contracts.geometry import PointLabel
from contracts.images import decode_jpeg, encode_jpeg
from contracts.llm_parser import ParseAnswer, ParseQuestion
from contracts.orchestrator import MissionSettings, ModelCalls
from contracts.vehicle import Observation
from contracts.vlm_gateway import (
    Answer,
    ChooseDirectionQuestion,
    FindObjectQuestion,
    FloorCountQuestion,
    Role,
    View,
)
from evaluation.metrics.model_calls import together
from evaluation.sim_client import SimClient
from evaluation.subtasks import choice, floors, parse, recognition
from evaluation.subtasks.figures import Figures, Subtask, SubtaskScores
from evaluation.subtasks.stage import Stage, staged
from evaluation.subtasks.stops import Stop, before_goal, before_start, on_lap
from evaluation.task_set.task import Task
from mission.annotation import mark_points
from mission.clients import AskedVehicle
from mission.model_calls import Answered, CallBook
from mission.places import ahead
from mission.policies import policy_of
from mission.policies.points import PointsMemory, marks_of, points_policy, search_task
from mission.ports import ModelUnreachable, Ports

A = TypeVar("A", bound=Answer | ParseAnswer)
ROLES: dict[Subtask, Role] = {
    "floors": "floors",
    "recognition": "recognition",
    "choice": "choice",
    "parse": "parser",
}


class Plan(NamedTuple):
    """Who is asked, and how often: `stops` places a task (two kinds of places for recognition, half each)."""

    backend: ModelName
    parser: ModelName | None = None
    stops: int = 4
    settings: MissionSettings = MissionSettings()


class Asked(Wire):
    """What came of one task's questions: those of the subtask at hand, in the order asked. `skipped`: stops that could
    not be reached, or had no question; `model`: who answered last, by its own account; `problem`: why not all could
    be asked."""

    task: Name
    parsed: tuple[parse.Parsed, ...] = ()
    counts: tuple[floors.Count, ...] = ()
    looks: tuple[recognition.JudgedLook, ...] = ()
    choices: tuple[choice.Choice, ...] = ()
    skipped: int = 0
    model: str | None = None
    calls: ModelCalls = ModelCalls()
    problem: str | None = None


def scored(subtask: Subtask, plan: Plan, asked: Sequence[Asked], wall_s: float) -> SubtaskScores:
    """The figures of a subtask over the tasks that were asked about."""
    figures: Figures
    if subtask == "parse":
        parsed = [item for task in asked for item in task.parsed]
        figures, questions = parse.score(parsed), len(parsed)
    elif subtask == "floors":
        counts = [item for task in asked for item in task.counts]
        figures, questions = floors.score(counts), len(counts)
    elif subtask == "recognition":
        looks = [item for task in asked for item in task.looks]
        figures, questions = recognition.score(looks), len(looks)
    else:
        choices = [item for task in asked for item in task.choices]
        figures, questions = choice.score(choices), len(choices)
    return SubtaskScores(
        subtask=subtask,
        backend=plan.backend,
        model=next((task.model for task in reversed(asked) if task.model is not None), None),
        tasks=len(asked),
        questions=questions,
        skipped=sum(task.skipped for task in asked),
        rates=figures.rates,
        values=figures.values,
        groups=figures.groups,
        sightings=plan.settings.sightings if subtask == "recognition" else None,
        model_calls=together([task.calls for task in asked]),
        wall_s=round(wall_s, 3),
    )


class Examiner:
    """Asks through the same ports as a mission, so that nothing about a question differs from a flight's."""

    def __init__(
        self, plan: Plan, ports: Ports, simulator: SimClient | None, about: AskedVehicle | None = None
    ) -> None:
        """`simulator` must tell the truth; the parser's subtask needs none. `about` is told whose pictures they are."""
        self._about = about or AskedVehicle()
        self._plan = plan
        self._ports = ports
        self._simulator = simulator
        self._book = CallBook()
        self._skipped = 0
        self._model: str | None = None

    async def ask(self, subtask: Subtask, task: Task) -> Asked:
        """All questions of one subtask about one task. Raises SimulatorFault, PortError."""
        self._book, self._skipped, self._model = CallBook(), 0, None
        return Asked(
            task=task.id,
            parsed=await self._parsed(task) if subtask == "parse" else (),
            counts=await self._counts(task) if subtask == "floors" else (),
            looks=await self._looks(task) if subtask == "recognition" else (),
            choices=await self._choices(task) if subtask == "choice" else (),
            skipped=self._skipped,
            model=self._model,
            calls=self._book.calls.get(ROLES[subtask], ModelCalls()),
        )

    async def _parsed(self, task: Task) -> tuple[parse.Parsed, ...]:
        question = ParseQuestion(request=task.request, model=self._plan.parser)
        try:
            answer = await self._ask("parser", self._ports.parser.parse(question))
        except ModelUnreachable:
            return ()
        found = (answer.floor, answer.object) if answer else (None, None)
        return (parse.Parsed(task.style, task.floor, task.object, *found),)

    async def _counts(self, task: Task) -> tuple[floors.Count, ...]:
        counts = []
        with self._stage(task) as stage:
            for _ in self._reached(stage, before_start(task, max(1, self._plan.stops // 2), self._rng(task))):
                seen = stage.look(stage.front)
                truth = stage.truth(stage.front)[0].floors_visible
                question = FloorCountQuestion(
                    model=self._plan.backend,
                    image=seen.views[0].image,
                    camera=seen.views[0].camera,
                )
                with contextlib.suppress(ModelUnreachable):
                    answer = await self._ask("floors", self._ports.vision.floor_count(question))
                    counts.append(floors.Count(truth, answer.floors if answer else None, task.building_kind))
        return tuple(counts)

    async def _looks(self, task: Task) -> tuple[recognition.JudgedLook, ...]:
        rng = self._rng(task)
        before = before_goal(task, (self._plan.stops + 1) // 2, rng)
        looks = []
        with self._stage(task) as stage:
            for _ in self._reached(stage, before + on_lap(task, self._plan.stops - len(before), rng)):
                seen, truth = stage.look(), stage.truth()
                question = FindObjectQuestion(
                    model=self._plan.backend,
                    object=task.object,
                    views=tuple(View(camera=view.camera, image=view.image) for view in seen.views),
                )
                with contextlib.suppress(ModelUnreachable):
                    answer = await self._ask("recognition", self._ports.vision.find_object(question))
                    matches = recognition.claimed(answer, self._plan.settings.sightings) if answer else None
                    looks.append(recognition.JudgedLook(task.object_kind, task.object_colour, truth, matches))
        return tuple(looks)

    async def _choices(self, task: Task) -> tuple[choice.Choice, ...]:
        choices = []
        with self._stage(task) as stage:
            for _ in self._reached(stage, on_lap(task, max(1, self._plan.stops // 2), self._rng(task))):
                with contextlib.suppress(ModelUnreachable):
                    made = await self._choice(task, stage)
                    if made is None:
                        self._skipped += 1
                    else:
                        choices.append(made)
        return tuple(choices)

    async def _choice(self, task: Task, stage: Stage) -> choice.Choice | None:
        """Viewpoint and points as a mission finds them; null where there is nothing to choose between."""
        seen = stage.look(depth=True)
        depths = {
            view.camera.name: ViewDepth(camera=view.camera, depth=view.depth)
            for view in seen.views
            if view.depth is not None
        }
        policy = points_policy(policy_of(self._plan.settings.viewpoint))
        asked = policy.viewpoint_question(list(depths.values()), None, PointsMemory(), 0)
        chosen = depths[(await self._ports.depth.viewpoint(asked)).camera]
        heading = chosen.camera.heading_deg
        beside = tuple(d for d in depths.values() if 0 < abs(d.camera.heading_deg - heading) <= 45)
        safe = await self._ports.depth.safe_distances(
            SafeDistancesQuestion(view=chosen, others=beside, settings=policy.settings.safe_distances)
        )
        offered = policy.offered(safe)
        ways = stage.remaining_m(tuple(ahead(seen.pose, p.bearing_deg, p.distance_m) for p in offered))
        if len(offered) < 2 or all(way is None for way in ways):
            return None
        label = await self._label(task, stage, seen, chosen.camera, offered, policy.settings.direction)
        remaining = {point.label: way for point, way in zip(offered, ways, strict=True)}
        return choice.Choice(remaining, label)

    async def _label(
        self,
        task: Task,
        stage: Stage,
        seen: Observation,
        camera: Camera,
        offered: list[DirectionPoint],
        direction: str,
    ) -> PointLabel | None:
        picture = next(decode_jpeg(view.image) for view in seen.views if view.camera == camera)
        points = marks_of(offered)
        question = ChooseDirectionQuestion(
            model=self._plan.backend,
            camera=camera,
            image=encode_jpeg(mark_points(picture, points)),
            points=points,
            task=search_task(task.object, task.floor, direction),
        )
        answer = await self._ask("choice", self._ports.vision.choose_direction(question))
        return answer.label if answer else None

    async def _ask(self, role: Role, call: Awaitable[A]) -> A | None:
        """An answer that can't be read or is declined is no answer; the book knows which it was. Raises
        ModelUnreachable, which the book counts as well: nothing of it may be scored."""
        reply = await self._book.ask(role, call)
        self._model = reply.answer.model
        return reply.answer if isinstance(reply, Answered) else None

    @contextmanager
    def _stage(self, task: Task) -> Iterator[Stage]:
        if self._simulator is None:
            raise ValueError("this subtask needs a simulator that tells the truth")
        with staged(self._simulator, task.scene, self._plan.settings.rig_flown) as stage:
            self._about.board(stage.episode)
            yield stage

    def _reached(self, stage: Stage, stops: Sequence[Stop]) -> Iterator[Stop]:
        """Flies from stop to stop; those that something is in the way of are counted and left out."""
        for stop in stops:
            if stage.go(stop):
                yield stop
            else:
                self._skipped += 1

    def _rng(self, task: Task) -> np.random.Generator:
        return np.random.default_rng((task.seed, zlib.crc32(b"subtasks")))
