"""The search by the contour explorer: depth_assist keeps no state, so the policy carries its map from stop to stop."""

import math
from typing import ClassVar

from contracts.depth_assist import ExploreAnswer, ExploreQuestion, ExploreSettings
from contracts.event_data import SearchData
from contracts.geometry import Point3
from mission.looks import Look
from mission.policies.base import NextStop, NothingLeft, Onward, Plan, SearchMemory, SearchPolicy, SearchTools, Told
from mission.ports import ServiceRefused

BEGIN_ANEW = frozenset({"no_facade", "outside_map"})
NEIGHBOUR_M = 12.0
"""Farther than this from every known wall of the target, a thing is across a street. What stands at the target's own
windows lies nearer: on such a wall, or on a wing next to it that no look has linked to it yet."""


class ContourMemory(SearchMemory):
    """The explorer's map as it came back; null before the first step, and to begin anew."""

    map: str | None = None


class ContourPolicy(SearchPolicy[ExploreSettings, ContourMemory]):
    """Along the facade in view, to where most of what is not inspected yet will be seen."""

    name: ClassVar[str] = "contour"
    label: ClassVar[str] = "contour explorer"
    settings_type = ExploreSettings
    memory_type = ContourMemory
    knows_building: ClassVar[bool] = True

    async def plan(self, look: Look, memory: ContourMemory, tools: SearchTools) -> Plan:
        """A refusal after which the search can begin anew is a plan too."""
        question = ExploreQuestion(
            views=tuple(sight.depth_view for sight in look.all),
            pose=look.pose,
            map=memory.map,
            building_box=tools.building_box,
            settings=self.settings,
        )
        try:
            answer = await tools.explore(question)
        except ServiceRefused as error:
            if error.code not in BEGIN_ANEW:
                raise
            return BeginAnew(look, memory, tools, str(error))
        return ContourPlan(look, tools, answer)


class BeginAnew(Plan):
    """No facade, or the map left behind: turn, and begin with an empty map."""

    def __init__(self, look: Look, memory: ContourMemory, tools: SearchTools, why: str) -> None:
        self._look, self._memory, self._tools, self._why = look, memory, tools, why

    async def onward(self) -> Onward:
        turn = self._tools.fallback_turn_deg
        stop = NextStop((), self._look.pose.yaw + math.radians(turn), f"turn {turn:g}° left: {self._why}")
        return Onward(stop, self._memory.model_copy(update={"map": None}))


class ContourPlan(Plan):
    """The explorer's answer to one look."""

    def __init__(self, look: Look, tools: SearchTools, answer: ExploreAnswer) -> None:
        self._look, self._tools, self._answer = look, tools, answer

    def on_target(self, place: Point3) -> bool:
        """Is that on the building searched, as its map with this look in it has it?"""
        known = self._answer.drawing.inspected + self._answer.drawing.uninspected
        return any(math.dist(cell, (place.x, place.y)) <= NEIGHBOUR_M for cell in known)

    async def onward(self) -> Onward:
        answer = self._answer
        said = f"{100 * answer.inspected_share:.0f} % of the known facade inspected"
        data = SearchData(
            exploration_step=self._tools.exploration_step,
            policy=ContourPolicy.name,
            drawing=answer.drawing,
            inspected_share=answer.inspected_share,
            stop=answer.stop,
            details=answer.model_dump(mode="json", exclude={"map", "drawing", "inspected_share", "stop"}),
        )
        told = Told(f"{answer.status}: {answer.reason}; {said}", data)
        memory = ContourMemory(map=answer.map, inspected_share=answer.inspected_share)
        return Onward(self._stop(said), memory, told)

    def _stop(self, said: str) -> NextStop | NothingLeft:
        answer = self._answer
        if answer.status == "done":
            share = f"{100 * answer.inspected_share:.0f} % of the facade on floor {self._tools.floor} inspected"
            return NothingLeft(f"the search is over, with {share}")
        if answer.stop is None:
            return NextStop((), answer.yaw, f"turn: {answer.reason}")
        goal = Point3(x=answer.stop.x, y=answer.stop.y, z=self._look.pose.z)
        return NextStop((goal,), answer.yaw, f"{answer.distance_m:.1f} m round the building; {said}")
