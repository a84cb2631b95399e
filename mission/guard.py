"""The flight guard: the last to see a flight, whoever planned it. Its limits are the operator's.

`GuardedVehicle` stands before every vehicle that a mission flies. It remembers what the cameras have shown and where
the drone has been, asks `navigation.guard` before each path, watches frames, pose, battery and time, and refuses by
name. Of what it remembers the mission's state keeps `GuardMemory`; whoever carries a mission on looks anew before it
flies.
"""

import time
from collections.abc import Callable, Sequence

import numpy as np

from contracts.flight_limits import FlightLimits, GuardAction, RefusalReason
from contracts.geometry import Point3, Pose
from contracts.vehicle import MAX_PATH_POINTS, Move, MoveResult, Observation, VehicleCapabilities, VehicleState
from mission.endurance import left_s
from mission.frames import FINAL, FlightRefused
from mission.guard_looks import HERE_M, GuardLooks
from mission.passing import OVER_M, Wait
from mission.places import distance_m, path_m, point_of
from mission.ports import ServiceRefused
from mission.state import GuardMemory, Trouble
from mission.taking_off import check_take_off
from mission.vehicle import Progress, Vehicle
from navigation import guard, passers_by
from navigation.airspace import Refusal, Space
from navigation.camera import Place
from navigation.camera import Pose as FlownPose
from navigation.keep_out import volumes

MANUAL = "manual_control"
"""The code by which a vehicle refuses what it is told, because somebody else flies it."""
FAST_SHARE = 1.15
_LIE_M = 1e-6


class GuardedVehicle:
    """A vehicle that flies only what the guard lets it fly: any `Vehicle`, but `fly` may raise FlightRefused as well.
    `clock`: seconds that only go forward. `waited_s`: so long the last flight waited for who walked by."""

    def __init__(
        self,
        vehicle: Vehicle,
        capabilities: VehicleCapabilities,
        limits: FlightLimits,
        memory: GuardMemory,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """`memory`: of the same mission's earlier flights."""
        self._vehicle = vehicle
        self._capabilities = capabilities
        self.limits = limits
        self._began, self._home = memory, memory.home
        self._clock = clock
        self._room_m = capabilities.radius_m + limits.min_clearance_m
        low_m = passers_by.HEAD_M + self._room_m
        self._seen = GuardLooks(memory, len(capabilities.cameras), limits.max_pose_jump_m, low_m, clock)
        self._pose = memory.stands
        self._trouble = memory.trouble
        self.waited_s = 0.0
        self._corners: list[Point3] = list(memory.flown)

    @property
    def memory(self) -> GuardMemory:
        """What whoever carries the mission on must know."""
        seen = self._seen
        learnt = {"top_m": seen.top_m, "reach_m": seen.reach_m, "passers_by": seen.passers_by}
        left = {"flown": tuple(self._corners), "stands": self._pose, "trouble": self._trouble}
        return self._began.model_copy(update=learnt | left)

    @property
    def name(self) -> str:
        return self._vehicle.name

    @property
    def ceiling_m(self) -> float:
        """How high it may fly here, above ground: so far above what stands beside it, as depth has shown it."""
        return min(self.limits.max_height_m, max(self._home.z, self._seen.top_m or 0.0) + self.limits.roof_margin_m)

    @property
    def looks(self) -> Sequence[guard.Look]:
        """What the cameras have shown, oldest first."""
        return self._seen.all

    @property
    def low_m(self) -> float:
        """Up to this height of the drone's centre, people and cars reach it."""
        return self._seen.low_m

    async def connect(self) -> VehicleCapabilities:
        return await self._vehicle.connect()

    async def state(self) -> VehicleState:
        return await self._vehicle.state()

    async def take_off(self, height_m: float) -> VehicleState:
        """Raises FlightRefused, PortError."""
        await check_take_off(self._vehicle, height_m, self._space()._replace(ceiling_m=self.limits.max_height_m))
        return self._stands(await self._vehicle.take_off(height_m))

    async def hold(self) -> VehicleState:
        return self._stands(await self._vehicle.hold())

    async def return_home(self) -> VehicleState:
        """Back along the way that it has flown, which was free. Raises PortError."""
        state = await self._vehicle.state()
        back = self._corners[-2::-1]
        for first in range(0, len(back), MAX_PATH_POINTS):
            path = tuple(back[first : first + MAX_PATH_POINTS])
            done = await self._vehicle.fly(state.moves + 1, Move(path=path))
            state = done.vehicle
            if not done.reached:
                break
        return self._stands(state)

    async def land(self) -> VehicleState:
        return self._stands(await self._vehicle.land())

    async def release(self) -> None:
        await self._vehicle.release()

    async def observe(self, cameras: Sequence[str] | None = None, *, depth: bool = True) -> Observation:
        """As the vehicle; what is seen is remembered, and whether it can be of now."""
        seen = await self._vehicle.observe(cameras, depth=depth)
        look = self._seen.remember(seen, self._pose)
        if look is not None:
            self._seen.learn(look)
        return seen

    async def fly(self, number: int, move: Move, progress: Progress | None = None) -> MoveResult:
        """Raises FlightRefused, PortError."""
        state = await self._vehicle.state()
        self.waited_s = 0.0
        if state.moves < number:
            await self._permit(move, state)
        before = state.pose
        try:
            done = await self._vehicle.fly(number, move, progress)
        except ServiceRefused as error:
            if error.code == MANUAL:
                raise FlightRefused("manual_control", str(error)) from None
            raise
        self._flown(before, move, done)
        return done

    async def end(self, reason: RefusalReason) -> GuardAction:
        """Brings the vehicle where it may stay; tells what was done: nothing, where somebody else flies it. Raises
        PortError."""
        try:
            return await self._ended(FINAL.get(reason, "hold"), reason)
        except ServiceRefused as error:
            if error.code == MANUAL:
                return "none"
            raise

    async def _ended(self, action: GuardAction, reason: RefusalReason) -> GuardAction:
        if action == "return":
            await self._vehicle.hold()
            state = await self._vehicle.state()
            if reason == "battery_reserve" and self._way_home_s(self._pose or state.pose) > self._left_s(state):
                action = "land"
            else:
                await self.return_home()
        if action == "land" or (action == "return" and self._capabilities.lands):
            await self.land()
        if action == "hold":
            await self.hold()
        return action

    async def watch(self) -> None:
        """Raises FlightRefused where it may not go on holding, PortError."""
        self._check_vehicle(Move(), await self._vehicle.state())

    @property
    def distrust(self) -> FlightRefused | None:
        """Why the last look is not to be gone by; null where it is."""
        return self._seen.frames.distrust

    def column_is_open(self, place: Place, to_m: float) -> bool:
        """May it climb there, as far as depth has shown?"""
        return guard.column_is_open(place, to_m, self._seen.all)

    @property
    def can_rise(self) -> bool:
        """May it climb out of reach of who walks by, whoever stands beside it?"""
        return self._seen.may_climb(self.low_m + OVER_M, self._space())

    def column_looks_open(self, place: Place, to_m: float) -> bool:
        """The same of a place elsewhere, as it is seen from here."""
        return guard.column_looks_open(place, to_m, self._seen.all)

    async def _permit(self, move: Move, state: VehicleState) -> None:
        """Returns where the move may be flown. Raises FlightRefused, PortError."""
        self._check_vehicle(move, state)
        if not move.path:
            return
        up_m = move.path[0].z - state.pose.z
        if self._seen.must_look(state, self.limits.max_frame_age_s, climbs=up_m > HERE_M):
            await self._look()
        if self._seen.frames.distrust is not None:
            raise self._seen.frames.distrust
        pose = FlownPose(state.pose.x, state.pose.y, state.pose.z, state.pose.yaw)
        path = [Place(p.x, p.y, p.z) for p in move.path]
        if not (self._seen.passers_by and passers_by.goes_low(path, pose, self.low_m)):
            await self._check(path, pose)
            return
        waits = Wait(self._seen, self._speed_m_s, self._look, lambda: pose.z < self.low_m and self.can_rise)
        self.waited_s = await waits.let_pass(path, pose, lambda: self._check(path, pose))

    async def _check(self, path: Sequence[Place], pose: FlownPose) -> None:
        """By what the looks so far have shown; before a refusal for which a look with part of the cameras may be the
        reason, by one with all of them. Raises FlightRefused, PortError."""
        refusal = self._refusal(path, pose)
        if refusal is not None and not self._seen.whole and self._may_mend(refusal):
            await self._look()
            refusal = self._refusal(path, pose)
        if refusal is not None:
            raise FlightRefused.by(refusal)

    def _may_mend(self, refusal: Refusal) -> bool:
        """May one look more clear the way? Not past what a sensor has shown that misses thin things."""
        return refusal.reason == "unseen" or (refusal.reason == "clearance" and not self._seen.all[-1].misses_thin)

    def _refusal(self, path: Sequence[Place], pose: FlownPose) -> Refusal | None:
        flown = np.array([(c.x, c.y, c.z) for c in self._corners] or [(pose.x, pose.y, pose.z)])
        out_of_reach = passers_by.rises(path, pose) and path[-1].z <= self.low_m + OVER_M + _LIE_M
        looks = self._seen.standing() if out_of_reach else self._seen.all
        return guard.check(path, looks, flown, pose, self._space())

    async def _look(self, *, instead: bool = False) -> float:
        """One look more, or one instead of the last; when it was taken, seconds. Raises FlightRefused, PortError."""
        seen = await self._vehicle.observe()
        self._seen.remember(seen, self._pose, instead=instead)
        if self._seen.frames.distrust is not None:
            raise self._seen.frames.distrust
        return seen.time_s if seen.time_s is not None else self._clock()

    def _space(self) -> Space:
        of, home = self.limits, Place(self._home.x, self._home.y, self._home.z)
        return Space(home, of.geofence_m, of.min_height_m, self.ceiling_m, self._room_m, volumes(of.keep_out))

    def _check_vehicle(self, move: Move, state: VehicleState) -> None:
        limits = self.limits
        if self._trouble is not None:
            raise FlightRefused(self._trouble.reason, self._trouble.message)
        if state.mode == "manual":
            raise FlightRefused("manual_control", ", ".join(state.health.problems) or "a pilot flies it")
        if not state.health.ok:
            raise FlightRefused("health", f"the drone reports a problem: {', '.join(state.health.problems)}")
        if self._pose is not None and (jump_m := distance_m(self._pose, state.pose)) > limits.max_pose_jump_m:
            raise FlightRefused("pose_jump", f"the drone says that it is {jump_m:.1f} m from where it was left")
        way_m = path_m(state.pose, move.path)
        needed_s = way_m / self._speed_m_s + self._way_home_s(self._pose or state.pose)
        needs = f"a way of {way_m:.0f} m and the way home may take {needed_s:.0f} s"
        if state.flight_s + needed_s > limits.max_flight_s:
            flown_s, allowed_s = state.flight_s, limits.max_flight_s
            raise FlightRefused("time_limit", f"{needs}; {flown_s:.0f} s are flown, {allowed_s:.0f} s are allowed")
        if state.battery.remaining is not None and needed_s > self._left_s(state):
            left, kept = 100 * state.battery.remaining, 100 * limits.battery_reserve
            raise FlightRefused("battery_reserve", f"{needs}; {left:.0f} % of the charge is left, {kept:.0f} % kept")

    def _flown(self, before: Pose, move: Move, done: MoveResult) -> None:
        if move.path:
            self._corners = self._corners or [point_of(self._home)]
            self._corners += [*(move.path[:-1] if done.reached else ()), point_of(done.pose)]
        self._stands(done.vehicle)
        end = move.path[-1] if move.path else before
        if done.reached and (off_m := distance_m(end, done.pose)) > self.limits.max_pose_jump_m:
            self._trouble = Trouble(reason="pose_jump", message=f"the drone ended {off_m:.1f} m from where it was sent")
        fast = self.limits.max_speed_m_s * FAST_SHARE
        if done.flight_s > 0.0 and done.path_m / done.flight_s > fast:
            said = f"flown at {done.path_m / done.flight_s:.1f} m/s; {self.limits.max_speed_m_s:g} m/s are allowed"
            self._trouble = Trouble(reason="speed", message=said)

    def _stands(self, state: VehicleState) -> VehicleState:
        self._pose = state.pose
        return state

    @property
    def _speed_m_s(self) -> float:
        """What it flies at on the whole, speeding up and braking, at least."""
        return max(0.5 * min(self._capabilities.max_speed_m_s, self.limits.max_speed_m_s), 0.1)

    def _way_home_s(self, pose: Pose) -> float:
        """Back along the way flown, but no longer than twice the straight way: by then it is known that it is free."""
        return 2.0 * distance_m(self._home, pose) / self._speed_m_s

    def _left_s(self, state: VehicleState) -> float:
        """Seconds of flight until the reserve is touched, by how fast the battery has emptied so far."""
        return left_s(state.battery.remaining, self._began.charge, state.flight_s, self.limits.battery_reserve)


async def guarded(vehicle: Vehicle, limits: FlightLimits, memory: GuardMemory | None) -> GuardedVehicle:
    """The vehicle behind the guard; without a memory the mission starts where it is now. Raises PortError."""
    capabilities = await vehicle.connect()
    if memory is None:
        state = await vehicle.state()
        memory = GuardMemory(home=state.pose, charge=state.battery.remaining)
    return GuardedVehicle(vehicle, capabilities, limits, memory)
