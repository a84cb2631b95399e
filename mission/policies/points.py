"""The paper's search: a view to follow (eq. 4-6), five points in it with safe distances (eq. 7), one chosen by a model.

`paper` follows the view along the building's edge; its ablations follow the side view always, or any view by chance.
"""

import math
from abc import abstractmethod
from collections.abc import Iterable, Sequence
from typing import Any, ClassVar, Generic, Literal, NamedTuple, TypeVar

from contracts.base import Metres, Wire
from contracts.cameras import Camera
from contracts.depth_assist import (
    DirectionPoint,
    SafeDistancesAnswer,
    SafeDistanceSettings,
    SafeDistancesQuestion,
    ViewDepth,
    ViewpointAnswer,
    ViewpointConstants,
    ViewpointQuestion,
    ViewpointSettings,
)
from contracts.event_data import DirectionData
from contracts.geometry import Box
from contracts.images import JpegImage, encode_jpeg, jpeg_bytes
from contracts.vlm_gateway import ChooseDirectionAnswer, ChooseDirectionQuestion, MarkedPoint
from mission.annotation import mark_points
from mission.looks import Look
from mission.model_calls import Answered, Reply
from mission.places import ahead, towards
from mission.policies.base import AnyPolicy, NextStop, Onward, Plan, SearchMemory, SearchPolicy, SearchTools, Told
from mission.wording import with_article

CENTRE = "c"


class PointsSettings(Wire):
    """`direction`: which way round the building. `choice`: who picks one of the points, the model or (an ablation)
    nobody: always the centre. Points nearer than `min_move_m` are not offered."""

    direction: Literal["clockwise", "counterclockwise"] = "clockwise"
    choice: Literal["model", "centre"] = "model"
    min_move_m: Metres = 1.0
    safe_distances: SafeDistanceSettings = SafeDistanceSettings()


class PaperSettings(PointsSettings, ViewpointConstants):
    """The points', and the free constants of eq. 4-6."""


class PointsMemory(SearchMemory):
    """`d_max_m`: eq. 6's, as the last step left it; null before the first."""

    d_max_m: Metres | None = None


class Ways(NamedTuple):
    """Where to look for the way on, and how far one may fly there; `marked` is what the choice model is shown."""

    view: ViewpointAnswer
    camera: Camera
    safe: SafeDistancesAnswer
    marked: JpegImage


class Chosen(NamedTuple):
    """Where to go: a point, or null to turn on the spot; `by` says who chose, or why not."""

    point: DirectionPoint | None
    by: str
    reply: Reply[ChooseDirectionAnswer] | None = None


S = TypeVar("S", bound=PointsSettings)


class PointsPolicy(SearchPolicy[S, PointsMemory], Generic[S]):
    """What the three have in common."""

    memory_type = PointsMemory

    @abstractmethod
    def view_rule(self) -> ViewpointSettings:
        """How depth_assist picks the view."""

    def viewpoint_question(
        self, views: Sequence[ViewDepth], box: Box | None, memory: PointsMemory, seed: int
    ) -> ViewpointQuestion:
        return ViewpointQuestion(
            views=tuple(views), building_box=box, settings=self.view_rule(), d_max_m=memory.d_max_m, seed=seed
        )

    def words(self) -> list[str]:
        """An arm without a choice model is an ablation of its own."""
        changed = super().words()
        return ["centre, no choice" if word.startswith("choice") else word for word in changed]

    def offered(self, safe: SafeDistancesAnswer) -> list[DirectionPoint]:
        """The points far enough off."""
        return [p for p in safe.points if p.distance_m >= self.settings.min_move_m]

    async def plan(self, look: Look, memory: PointsMemory, tools: SearchTools) -> Plan:
        question = self.viewpoint_question(
            [sight.depth_view for sight in look.all], tools.building_box, memory, tools.seed
        )
        view = await tools.viewpoint(question)
        sight = look.sights[view.camera]  # depth_assist answers with one of the views that it was sent
        safe = await tools.safe_distances(
            SafeDistancesQuestion(
                view=sight.depth_view,
                others=look.depth_beside(sight),
                height_m=max(0.0, look.pose.z),
                settings=self.settings.safe_distances,
            )
        )
        marked = encode_jpeg(mark_points(sight.rgb, marks_of(self.offered(safe))))
        return PointsPlan(self, look, tools, Ways(view, sight.view.camera, safe, marked))


class PointsPlan(Plan):
    """The points of one look; which of them is decided by `onward`."""

    def __init__(self, policy: PointsPolicy[S], look: Look, tools: SearchTools, ways: Ways) -> None:
        self._settings: PointsSettings = policy.settings
        self._offered = policy.offered(ways.safe)
        self._look, self._tools, self._ways = look, tools, ways

    async def onward(self) -> Onward:
        chosen = await self._choose()
        memory = PointsMemory(d_max_m=self._ways.view.d_max_next_m)
        pose, point = self._look.pose, chosen.point
        if point is None:
            turn = self._tools.fallback_turn_deg
            stop = NextStop((), pose.yaw + math.radians(turn), f"turn {turn:g}° left: {chosen.by}")
        else:
            goal = ahead(pose, point.bearing_deg, point.distance_m)
            stop = NextStop((goal,), None, f"{point.distance_m:.1f} m towards point {point.label}, {chosen.by}")
        return Onward(stop, memory, self._told(chosen))

    async def _choose(self) -> Chosen:
        view, offered = self._ways.view, self._offered
        if not offered:
            return Chosen(None, f"no way of {self._settings.min_move_m:g} m is free {towards(view.heading_deg)}")
        if self._settings.choice == "centre":
            return _centre(offered, self._settings.min_move_m)
        question = ChooseDirectionQuestion(
            model=self._tools.vision_model,
            camera=self._ways.camera,
            image=self._ways.marked,
            points=marks_of(offered),
            task=search_task(self._tools.object, self._tools.floor, self._settings.direction),
        )
        reply = await self._tools.choose_direction(question)
        label = reply.answer.label if isinstance(reply, Answered) else None
        point = next((p for p in offered if p.label == label), None)
        if point is not None:
            return Chosen(point, "the model's choice", reply)
        why = "none of the points offered" if reply.answer.outcome == "answered" else reply.answer.outcome
        return Chosen(_widest(offered), f"the choice model's answer was {why}", reply)

    def _told(self, chosen: Chosen) -> Told:
        view, _, safe, marked = self._ways
        message = f"view {towards(view.heading_deg)} ({view.reason.replace('_', ' ')}): " + (
            f"point {chosen.point.label}, {chosen.by}" if chosen.point else chosen.by
        )
        data = DirectionData(
            exploration_step=self._tools.exploration_step,
            camera=view.camera,
            heading_deg=view.heading_deg,
            viewpoint=view,
            points=safe.points,
            offered=tuple(p.label for p in self._offered),
            label=chosen.point.label if chosen.point else None,
            by=chosen.by,
            answer=chosen.reply.answer if chosen.reply else None,
            seconds=round(chosen.reply.seconds, 4) if chosen.reply else None,
        )
        return Told(message, data, lambda: {"marked": jpeg_bytes(marked)})


class PaperPolicy(PointsPolicy[PaperSettings]):
    name: ClassVar[str] = "paper"
    label: ClassVar[str] = "paper's rule"
    settings_type = PaperSettings

    def view_rule(self) -> ViewpointSettings:
        constants = self.settings.model_dump(include=set(ViewpointConstants.model_fields))
        return ViewpointSettings(policy="paper", direction=self.settings.direction, **constants)


class RandomPolicy(PointsPolicy[PointsSettings]):
    """The ablation that follows any view, drawn by the mission's seed."""

    name: ClassVar[str] = "random"
    label: ClassVar[str] = "random view"
    settings_type = PointsSettings

    def view_rule(self) -> ViewpointSettings:
        return ViewpointSettings(policy="random", direction=self.settings.direction)


class DefaultPolicy(PointsPolicy[PointsSettings]):
    """The ablation that always follows the view along the building."""

    name: ClassVar[str] = "default"
    label: ClassVar[str] = "right-hand view"
    settings_type = PointsSettings

    def view_rule(self) -> ViewpointSettings:
        return ViewpointSettings(policy="default", direction=self.settings.direction)


POINTS_POLICIES = (PaperPolicy.name, RandomPolicy.name, DefaultPolicy.name)
"""The paper's rule and its two ablations."""


def points_policy(policy: AnyPolicy) -> PointsPolicy[Any]:
    """The policy if it offers points; else the paper's, for whoever asks about points without a search."""
    return policy if isinstance(policy, PointsPolicy) else PaperPolicy(PaperSettings())


def _centre(offered: list[DirectionPoint], min_move_m: float) -> Chosen:
    """The ablation: always the point straight ahead."""
    point = next((p for p in offered if p.label == CENTRE), None)
    if point is None:
        return Chosen(None, f"the way straight ahead is shorter than {min_move_m:g} m")
    return Chosen(point, "always the centre")


def _widest(offered: list[DirectionPoint]) -> DirectionPoint:
    """Without a usable answer: the centre where it is offered, else the longest way."""
    return next((p for p in offered if p.label == CENTRE), None) or max(offered, key=lambda p: p.distance_m)


def marks_of(points: Iterable[DirectionPoint]) -> tuple[MarkedPoint, ...]:
    """The points as they are drawn into the picture and offered to the model."""
    return tuple(MarkedPoint(label=p.label, x=p.x, y=p.y, distance_m=p.distance_m) for p in points)


def search_task(thing: str, floor: int, direction: str) -> str:
    """What the choice model is told about the search; `direction` is the policy's."""
    side = "right" if direction == "clockwise" else "left"
    return (
        f"Find the window with {with_article(thing)} on floor {floor}. The drone flies {direction} round the building, "
        f"which is on its {side}."
    )
