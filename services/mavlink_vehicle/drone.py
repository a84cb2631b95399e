"""The flights of a drone behind an autopilot: take-off, courses, hold, return, landing. In its own local frame.

Every flight looks twenty times a second whether it may go on. It ends early by Stopped (told to), TakenOver (somebody
else flies), LinkLost, Hit (the world outside says so), or StuckOnTheWay.
"""

import asyncio
import logging
import math
from collections.abc import Callable
from contextlib import suppress

from episode_kit.kinematics import wrapped
from services.mavlink_vehicle.control import Control
from services.mavlink_vehicle.course import Course
from services.mavlink_vehicle.flight_ends import Hit, Leapt, Patience, Stopped, StuckOnTheWay, TakenOver, Tolerance
from services.mavlink_vehicle.frames import Alignment, Enu
from services.mavlink_vehicle.link import CommandRefused, Link, LinkLost
from services.mavlink_vehicle.set_points import EVERY_S, SetPoints
from services.mavlink_vehicle.telemetry import STALE_POSE_S, Telemetry

log = logging.getLogger("mavlink_vehicle.drone")

LINK_PATIENCE_S = 8.0
READY_WITHIN_S = 40.0
STREAM_FIRST_S = 0.6
TRIES, TRY_AGAIN_S = 10, 0.5
TOLD_AFTER_S = 0.1
RISES_WITHIN_S, SLOWEST_CLIMB_M_S, OFF_GROUND_M = 30.0, 0.5, 1.0
ALMOST_UP_M = 0.3
LANDS_WITHIN_S = 180.0
DISARMS_WITHIN_S = 8.0
RETURNS_WITHIN_S = 300.0
OVER_HOME_M = 1.0
SLOW_M_S = 0.35
STOPS_WITHIN_S = 6.0
LONGEST_WAY_S = 600.0
ARMABLE_WITHIN_S = 8.0
NOT_TO_BE_ARMED = ("land", "return_to_launch", "mission")
CALM_S = 0.3


class Drone:
    """`arms_within_s`: so long it is asked again where it refuses to arm."""

    def __init__(self, link: Link, tolerance: Tolerance | None = None, arms_within_s: float = 30.0) -> None:
        self.link = link
        self.telemetry: Telemetry = link.telemetry
        self.control = Control(link.telemetry)
        self.set_points = SetPoints(link)
        self.tolerance = tolerance or Tolerance()
        self._arms_within_s = arms_within_s
        self.launch: Enu | None = None
        self.stop_asked = False
        self.hit: str | None = None

    async def run(self) -> None:
        """Streams and watches until it is cancelled."""
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self.set_points.run())
            tasks.create_task(self._watch())

    async def _watch(self) -> None:
        while True:
            self.control.check()
            if self.control.taken is not None and self.set_points.aim_at is not None:
                log.warning("%s: nothing is commanded any more", self.control.taken)
                self.set_points.stop()
            if self.control.taken is not None and not self.telemetry.armed and self.telemetry.landed:
                self.control.leave()
            await asyncio.sleep(EVERY_S)

    async def ready(self) -> None:
        """Waits until its estimate is good enough to fly by. Raises CommandRefused, which says what is missing,
        LinkLost."""
        telemetry = self.telemetry
        give_up_s = telemetry.clock() + READY_WITHIN_S
        while telemetry.missing or telemetry.place is None:
            if telemetry.clock() > give_up_s:
                if telemetry.lost:
                    raise LinkLost(self.link.silence)
                missing = telemetry.missing or ("a position",)
                raise CommandRefused(f"the autopilot is not ready, it lacks {', '.join(missing)}{telemetry.last_words}")
            if self.stop_asked:
                raise Stopped("it was told to stop")
            await asyncio.sleep(EVERY_S)

    async def armed(self) -> Enu:
        """Waits until it is ready, and arms; where it stands then. Raises CommandRefused, LinkLost, Interrupted."""
        self.control.leave()
        await self.ready()
        self.control.expect("ready", "takeoff", "hold", "offboard", self.telemetry.mode)
        give_up_s = self.telemetry.clock() + self._arms_within_s
        while True:
            try:
                await self._arm()
                break
            except CommandRefused:  # a self-test may take its time after the estimate is there
                if self.telemetry.clock() > give_up_s:
                    raise
                await self._until(lambda: False, TRY_AGAIN_S)
        told_s = self.telemetry.clock() + TOLD_AFTER_S  # arming may set the estimate anew: what is told after it counts
        await self._until(lambda: self.telemetry.poses.told_s > told_s, STALE_POSE_S)
        self.launch = here = self._here()
        return here

    async def _arm(self) -> None:
        if self.link.firmware == "ardupilot":
            # its take-off is one of GUIDED, and a set-point on the ground would end it
            self.set_points.stop()
            await self.link.take_set_points()
        elif self.telemetry.mode in NOT_TO_BE_ARMED or not await self._until(
            lambda: self.telemetry.armable is not False, ARMABLE_WITHIN_S
        ):
            # without a stick, and after a landing, some modes can't be armed in; holding can
            with suppress(CommandRefused):
                await self.link.hold()
        await self._until(lambda: self.telemetry.armable is not False, ARMABLE_WITHIN_S)
        await self.link.arm()  # whatever is wrong still, the autopilot says it best

    async def take_off(self, start: Enu, height_m: float) -> None:
        """Armed, from the ground at `start` to `height_m` above it. Raises CommandRefused, LinkLost, Interrupted."""
        await self.link.take_off(height_m)
        up_m, patience = start.up_m + height_m, Patience()

        def almost_up() -> bool:
            if (place := self.telemetry.place) is None:
                return False
            short_m = up_m - place.up_m
            # PX4 rises to a height of its own and holds there; others stay a little lower than they were told
            rests = patience.over(short_m, self.telemetry.clock()) or self.telemetry.mode == "hold"
            hovers = rests and self.telemetry.in_air and self.telemetry.speed_m_s < SLOW_M_S
            return short_m < ALMOST_UP_M or (hovers and place.up_m > start.up_m + OFF_GROUND_M)

        within_s = RISES_WITHIN_S + height_m / SLOWEST_CLIMB_M_S
        if not await self._until(almost_up, within_s):
            raise StuckOnTheWay(f"it did not rise within {within_s:.0f} s{self.telemetry.last_words}")
        await self.take_over(start._replace(up_m=up_m))
        await self._settle(start._replace(up_m=up_m))

    async def take_over(self, place: Enu) -> None:
        """Flies by set-points from now on, at first to `place`. Raises CommandRefused, LinkLost, Interrupted."""
        self.set_points.aim(place)
        await self._until(lambda: False, STREAM_FIRST_S)
        for attempt in range(TRIES):
            mode = self.telemetry.mode  # a take-off that is over meanwhile ends in holding, by itself
            self.control.expect("offboard", mode, "hold" if mode == "takeoff" else mode)
            try:
                await self.link.take_set_points()
                break
            except CommandRefused:
                if attempt == TRIES - 1:
                    self.set_points.stop()
                    raise
                await self._until(lambda: False, TRY_AGAIN_S)
        self.control.expect("offboard")

    async def fly(self, course: Course, alignment: Alignment, on_the_way: Callable[[float], None]) -> None:
        """Raises LinkLost, Interrupted; whatever is raised, it holds where it is then, unless somebody else flies."""
        flown_s, whole_s = 0.0, course.duration_s
        self.telemetry.leapt_m = None
        for part in course.parts:
            begun_s, time_s, patience = self.telemetry.clock(), 0.0, Patience()
            end = alignment.local(part.end, part.end.yaw)
            try:
                while not self._there(time_s - part.duration_s, end, patience):
                    point = course.at(part, time_s)
                    self.set_points.aim(alignment.local(point, point.yaw))
                    on_the_way(min(1.0, (flown_s + min(time_s, part.duration_s)) / whole_s))
                    await self._go_on()
                    time_s = self.telemetry.clock() - begun_s
            except (Stopped, Hit, Leapt):
                point = course.stop(part, time_s)
                self.set_points.aim(alignment.local(point, point.yaw))
                await self._calm_down()
                raise
            flown_s += part.duration_s
            self.set_points.aim(end)
        if course.parts:
            await self._settle(alignment.local(course.parts[-1].end, course.parts[-1].end.yaw))

    async def hold(self) -> None:
        """Where it is, by set-points. Raises CommandRefused, LinkLost, Interrupted."""
        if not self.control.ours or self.set_points.aim_at is None or self.telemetry.mode != "offboard":
            await self.take_over(self._here())
        await self._calm_down()

    async def return_to_launch(self) -> None:
        """By the autopilot's own way; over where it took off this service takes it again, and holds. Raises
        CommandRefused, LinkLost, Interrupted."""
        home = self.launch or self.telemetry.home
        if home is None:
            raise CommandRefused("nobody knows where it took off")
        self.control.expect("return_to_launch", "land", "hold")
        self.set_points.stop()
        await self.link.return_to_launch()

        def over_home() -> bool:
            place = self.telemetry.place
            return place is not None and math.dist(place[:2], home[:2]) < OVER_HOME_M

        if not await self._until(lambda: over_home() or not self.telemetry.in_air, RETURNS_WITHIN_S):
            raise StuckOnTheWay(f"it did not come home within {RETURNS_WITHIN_S:g} s")
        if self.telemetry.in_air:
            here = self._here()
            await self.take_over(here._replace(east_m=home.east_m, north_m=home.north_m))
            await self._settle(here._replace(east_m=home.east_m, north_m=home.north_m))

    async def land(self) -> None:
        """Down, where it is; over when it stands and its motors rest. Raises CommandRefused, LinkLost, Interrupted."""
        self.control.expect("land", "hold", "ready")
        self.set_points.stop()
        await self.link.land()
        if not await self._until(lambda: self.telemetry.landed is True, LANDS_WITHIN_S):
            raise StuckOnTheWay(f"it did not land within {LANDS_WITHIN_S:g} s{self.telemetry.last_words}")
        if not await self._until(lambda: not self.telemetry.armed, DISARMS_WITHIN_S):
            await self.link.disarm()  # its own timer may be switched off
        self.control.leave()

    async def leave(self) -> None:
        """It stays in the air by itself, and this service has done with it. Raises CommandRefused, LinkLost."""
        if self.control.ours and self.telemetry.in_air:
            self.control.expect("hold", "offboard")
            await self.link.hold()
        self.set_points.stop()
        self.control.leave()

    def _here(self) -> Enu:
        place = self.telemetry.place
        if place is None:
            raise LinkLost("the autopilot has not said for a second where it is")
        return place

    def _there(self, late_s: float, end: Enu, patience: Patience) -> bool:
        """At a corner, or as near as it asks. Raises StuckOnTheWay."""
        if late_s < 0.0:
            return False
        off_m = self._off(end)
        if patience.over(off_m, self.telemetry.clock()) and off_m > self.tolerance.lost_m:
            raise StuckOnTheWay(f"it stays {off_m:.1f} m from where it is sent{self.telemetry.last_words}")
        near_m = self.tolerance.lost_m if patience.ended else self.tolerance.corner_m
        return off_m < near_m

    def _off(self, end: Enu) -> float:
        place = self.telemetry.place
        return math.inf if place is None else math.dist(place[:3], end[:3])

    async def _settle(self, end: Enu) -> None:
        """Waits until it hovers there. Raises StuckOnTheWay where it stays far off; nearer than that it has come as
        near as it does."""
        tolerance, since_s, patience = self.tolerance, math.inf, Patience()

        def turned() -> bool:
            place = self.telemetry.place
            return place is not None and abs(wrapped(place.yaw - end.yaw)) < tolerance.end_rad

        def over() -> bool:
            nonlocal since_s
            now_s, off_m = self.telemetry.clock(), self._off(end)
            calm = off_m < tolerance.end_m and turned() and self.telemetry.speed_m_s < SLOW_M_S
            since_s = min(since_s, now_s) if calm else math.inf
            return now_s - since_s >= CALM_S or patience.over(off_m, now_s)

        await self._until(over, LONGEST_WAY_S)
        if self._off(end) > tolerance.lost_m:
            raise StuckOnTheWay(f"it stays {self._off(end):.1f} m from where it is sent{self.telemetry.last_words}")

    async def _calm_down(self) -> None:
        """It was told to stop: waits until it has. Nothing but somebody else's hand breaks this off."""
        give_up_s = self.telemetry.clock() + STOPS_WITHIN_S
        while self.telemetry.clock() < give_up_s and self.control.taken is None:
            await asyncio.sleep(EVERY_S)
            if self.telemetry.speed_m_s < SLOW_M_S:
                return

    async def _until(self, done: Callable[[], bool], within_s: float) -> bool:
        """Whether it came true within that time. Raises LinkLost, Interrupted."""
        give_up_s = self.telemetry.clock() + within_s
        while not done():
            if self.telemetry.clock() > give_up_s:
                return False
            await self._go_on()
        return True

    async def _go_on(self) -> None:
        """The next look. Raises LinkLost, Interrupted."""
        await asyncio.sleep(EVERY_S)
        self.control.check()
        if self.control.taken is not None:
            raise TakenOver(self.control.taken)
        if self.telemetry.silent_s > LINK_PATIENCE_S:
            raise LinkLost(self.link.silence)
        if self.telemetry.leapt_m is not None:
            leapt_m, self.telemetry.leapt_m = self.telemetry.leapt_m, None
            raise Leapt(f"its estimate of where it is has leapt by {leapt_m:.1f} m")
        if self.hit is not None:
            hit, self.hit = self.hit, None
            raise Hit(f"it has hit {hit}")
        if self.stop_asked:
            raise Stopped("it was told to stop")
