"""A search policy: out of the view along the building, always to the point with the longest free way. No model is
asked."""

import math
from typing import ClassVar, Literal

from contracts.base import Metres, Wire
from contracts.depth_assist import SafeDistancesQuestion, ViewpointQuestion, ViewpointSettings
from contracts.event_data import SearchData
from contracts.geometry import Pose
from mission.looks import Look
from mission.places import ahead
from mission.policies.base import NextStop, NothingLeft, Onward, Plan, SearchMemory, SearchPolicy, SearchTools, Told


class WidestWaySettings(Wire):
    """`least_m`: shorter ways are not flown; after `patience` stops in a row without one the search is over."""

    direction: Literal["clockwise", "counterclockwise"] = "clockwise"
    least_m: Metres = 1.0
    patience: int = 12


class WidestWayMemory(SearchMemory):
    """`stuck`: for how many stops no way was long enough."""

    stuck: int = 0


class WidestWay(SearchPolicy[WidestWaySettings, WidestWayMemory]):
    name: ClassVar[str] = "widest-way"
    label: ClassVar[str] = "widest way"
    settings_type = WidestWaySettings
    memory_type = WidestWayMemory

    async def plan(self, look: Look, memory: WidestWayMemory, tools: SearchTools) -> Plan:
        rule = ViewpointSettings(policy="default", direction=self.settings.direction)
        views = tuple(sight.depth_view for sight in look.all)
        view = await tools.viewpoint(ViewpointQuestion(views=views, settings=rule))
        sight = look.sights[view.camera]
        question = SafeDistancesQuestion(view=sight.depth_view, others=look.depth_beside(sight))
        widest = max((await tools.safe_distances(question)).points, key=lambda point: point.distance_m)
        if widest.distance_m >= self.settings.least_m:
            goal = ahead(look.pose, widest.bearing_deg, widest.distance_m)
            stop = NextStop((goal,), None, f"{widest.distance_m:.1f} m along the widest way")
            found = SearchData(
                exploration_step=tools.exploration_step,
                policy=self.name,
                details={"way": widest.label, "free_m": round(widest.distance_m, 2)},
            )
            return Decided(Onward(stop, WidestWayMemory(), Told(f"widest way: {widest.label}", found)))
        return Decided(self._stuck(look.pose, memory.stuck + 1, tools.fallback_turn_deg))

    def _stuck(self, pose: Pose, stuck: int, turn_deg: float) -> Onward:
        memory = WidestWayMemory(stuck=stuck)
        if stuck >= self.settings.patience:
            return Onward(NothingLeft(f"no way was free for {stuck} stops"), memory)
        return Onward(NextStop((), pose.yaw + math.radians(turn_deg), "turn: no way is free"), memory)


class Decided(Plan):
    """Nothing is left to be asked: the way on follows from the look."""

    def __init__(self, onward: Onward) -> None:
        self._onward = onward

    async def onward(self) -> Onward:
        return self._onward
