"""The way on by the contour explorer: depth_assist keeps no state, so the search carries its map from stop to stop."""

import math
from dataclasses import dataclass

from contracts.depth_assist import ExploreAnswer, ExploreQuestion
from contracts.event_data import ContourData
from contracts.geometry import Point3
from mission.ports import ServiceRefused
from mission.sortie import Look, MissionEnd, Sortie

Plan = ExploreAnswer | ServiceRefused
BEGIN_ANEW = frozenset({"no_facade", "outside_map"})
NEIGHBOUR_M = 12.0
"""Farther than this from every known wall of the target, a thing is across a street. What stands at the target's own
windows lies nearer: on such a wall, or on a wing next to it that no look has linked to it yet."""


@dataclass
class ContourSearch:
    """`inspected_share`: of the facade known or expected after the last step; null before the first."""

    sortie: Sortie
    inspected_share: float | None = None
    _map: str | None = None

    async def plan(self, look: Look) -> Plan:
        """What the explorer says to this look; a refusal after which the search can begin anew is an answer too.
        Changes nothing. Raises PortError."""
        try:
            return await self._ask(look)
        except ServiceRefused as error:
            if error.code not in BEGIN_ANEW:
                raise
            return error

    async def go_on(self, look: Look, plan: Plan) -> None:
        """One move or turn. Raises MissionEnd: object_not_found where nothing is left to inspect; PortError."""
        sortie = self.sortie
        if isinstance(plan, ServiceRefused):
            self._map = None
            turn = sortie.settings.fallback_turn_deg
            await sortie.fly((), look.pose.yaw + math.radians(turn), f"turn {turn:g}° left: {plan}")
            return
        answer = plan
        self._map, self.inspected_share = answer.map, answer.inspected_share
        said = f"{100 * answer.inspected_share:.0f} % of the known facade inspected"
        sortie.write(
            f"{answer.status}: {answer.reason}; {said}",
            ContourData(
                exploration_step=sortie.exploration_steps, explore=answer.explore_step, map_bytes=len(answer.map)
            ),
        )
        if answer.status == "done":
            raise MissionEnd(
                "object_not_found",
                f"no window with {sortie.thing} was found; the search is over, with "
                f"{100 * answer.inspected_share:.0f} % of the facade on floor {sortie.floor} inspected",
            )
        if answer.stop is None:
            await sortie.fly((), answer.yaw, f"turn: {answer.reason}")
            return
        goal = Point3(x=answer.stop.x, y=answer.stop.y, z=look.pose.z)
        await sortie.fly((goal,), answer.yaw, f"{answer.distance_m:.1f} m round the building; {said}")

    @staticmethod
    def on_target(plan: Plan, place: Point3) -> bool:
        """Is that on the building searched, as its map with this look in it has it? Without a map everything is."""
        if isinstance(plan, ServiceRefused):
            return True
        known = plan.drawing.inspected + plan.drawing.uninspected
        return any(math.dist(cell, (place.x, place.y)) <= NEIGHBOUR_M for cell in known)

    async def _ask(self, look: Look) -> ExploreAnswer:
        sortie = self.sortie
        question = ExploreQuestion(
            views=tuple(sight.depth_view for sight in look.sights.values()),
            pose=look.pose,
            map=self._map,
            building_box=sortie.building_box,
            settings=sortie.settings.explore,
        )
        return await sortie.timed("explore", sortie.ports.depth.explore(question))
