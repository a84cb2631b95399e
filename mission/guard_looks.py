"""What the flight guard has seen: the last looks, how far the sensors reach, how high things are, and who walks by."""

import math
from collections.abc import Callable, Sequence

from contracts.geometry import Pose
from contracts.images import BadImage, decode_depth
from contracts.vehicle import Observation, VehicleState
from mission.frames import FrameWatch
from mission.looks import FAR_M, navigation_camera
from mission.state import GuardMemory
from navigation import guard, passers_by
from navigation.airspace import Space, outside
from navigation.camera import DepthView, Place
from navigation.camera import Pose as FlownPose
from navigation.sensing import shown_reach_m

LOOKS_KEPT = 12
HERE_M = 0.5
"""A look from farther off does not show what is about the drone."""
COMES_DOWN_M = 1.0


class GuardLooks:
    """`cameras`: how many a whole look has; `low_m`: up to where people and cars reach, for the drone's centre."""

    def __init__(
        self, memory: GuardMemory, cameras: int, max_jump_m: float, low_m: float, clock: Callable[[], float]
    ) -> None:
        """`memory`: of the same mission's earlier flights. `resumed`: people or cars moved before this guard began to
        look, and no looks of its own have shown yet where they are."""
        self.low_m = low_m
        self.frames = FrameWatch(cameras, max_jump_m)
        self.reach_m, self.top_m, self.passers_by = memory.reach_m, memory.top_m, memory.passers_by
        self.resumed = memory.passers_by
        self._cameras, self._clock = cameras, clock
        self._looks: list[guard.Look] = []
        self._looked_s = -math.inf

    @property
    def all(self) -> Sequence[guard.Look]:
        """Oldest first."""
        return self._looks

    def must_look(self, state: VehicleState, max_age_s: float, *, climbs: bool) -> bool:
        """Is the last look too old, from elsewhere, or without the cameras that a climb needs?"""
        if not self._looks or self._clock() - self._looked_s > max_age_s:
            return True
        then, here = self._looks[-1].pose, state.pose
        elsewhere = math.dist((then.x, then.y, then.z), (here.x, here.y, here.z)) > HERE_M
        return elsewhere or (climbs and not self.whole)

    def remember(self, seen: Observation, expected: Pose | None, *, instead: bool = False) -> guard.Look | None:
        """One more look, or one instead of the last; null where it has no depth. `expected`: where the drone was
        left."""
        views = []
        for view in seen.views:
            if view.depth is None:
                continue
            try:
                views.append(DepthView(navigation_camera(view.camera), decode_depth(view.depth)))
            except BadImage:
                continue  # whoever asked for the picture says what is wrong with it
        if not views:
            return None
        self.frames.see(seen, views, expected)
        reach_m = max(self.reach_m, min(FAR_M, shown_reach_m(views)))
        pose = FlownPose(seen.pose.x, seen.pose.y, seen.pose.z, seen.pose.yaw)
        look = guard.look_of(views, pose, shown_m=reach_m)
        kept = self._looks[:-1] if instead else self._looks
        self._looks = [*kept[-LOOKS_KEPT + 1 :], look]
        self._looked_s = self._clock()
        return look

    def learn(self, look: guard.Look) -> None:
        """What the mission's own looks teach is part of its state; a step that is done again makes them again."""
        self.reach_m = max(self.reach_m, look.reach_m)
        if (top_m := guard.top_beside_m(look)) is not None:
            self.top_m = max(top_m, self.top_m or 0.0)
        self.passers_by = self.passers_by or bool(self.movers())

    @property
    def whole(self) -> bool:
        """Was the last look with all cameras?"""
        return bool(self._looks) and len(self._looks[-1].views) >= self._cameras

    def standing(self) -> Sequence[guard.Look]:
        """The looks without who moves, where that can be told."""
        return passers_by.without(self._looks, self.movers()) if self.passers_by and self.whole else self._looks

    def may_climb(self, to_m: float, space: Space) -> bool:
        """May the drone climb where it looked last, in the space allowed and whoever stands beside it? Before it has
        looked nothing is known to hang there; it looks before it flies."""
        if not self._looks:
            return True
        pose = self._looks[-1].pose
        here, up = Place(pose.x, pose.y, pose.z), Place(pose.x, pose.y, to_m)
        return outside(here, up, space) is None and guard.column_is_open(here, to_m, self.standing())

    def movers(self) -> list[passers_by.Mover]:
        """Who moves near a drone that is low or may come down, as the last look shows it."""
        if not self._looks or self._looks[-1].pose.z > self.low_m + COMES_DOWN_M:
            return []
        return passers_by.movers(self._looks[-1], self._looks[:-1])
