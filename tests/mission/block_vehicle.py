"""The block world's drone as a vehicle, and its trial: a small honest one, in process."""

import asyncio
import math
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from contracts.cameras import Rig
from contracts.geometry import Point3, Pose
from contracts.images import encode_depth, encode_jpeg
from contracts.sim import EpisodeQuestion, Verdict
from contracts.vehicle import (
    Battery,
    FlightMode,
    Move,
    MoveProgress,
    MoveResult,
    Observation,
    PoseUncertainty,
    SensedView,
    VehicleCapabilities,
    VehicleState,
)
from mission.ports import ServiceRefused, ServiceUnreachable
from mission.vehicle import Progress
from tests.mission.block import RADIUS_M, SIZE, Block

SPEED_M_S = 4.0
STEP_M = 0.1
ENDURANCE_S = 1500.0
Place = tuple[float, float, float]
Asked = Callable[[], bool]
"""Is it so now?"""
HOVER_S = 0.01


class Leg(NamedTuple):
    """How far a straight flight came, and what stopped it."""

    end: Place
    flown_m: float
    level_m: float
    hit: str | None
    cancelled: bool


class BlockVehicle:
    """Flies at `SPEED_M_S`; `pace`: seconds of wall time for a second of flight; `slow_s`: slept at every look;
    `away`: nobody answers; `hovers`: no look ends; `rests_below_m`: so far below the end of its path it comes to
    rest."""

    def __init__(
        self,
        block: Block,
        name: str,
        rig: Rig,
        *,
        pace: float = 0.0,
        slow_s: float = 0.0,
        size: int = SIZE,
        away: Asked = lambda: False,
        hovers: Asked = lambda: False,
        rests_below_m: float = 0.0,
    ) -> None:
        self.block = block
        self._rests_below_m = rests_below_m
        self._away = away
        self._hovers = hovers
        self.looks = 0
        self.holds = 0
        self.released = False
        self._rig = rig.scaled_to(size)
        self._pace = pace
        self._slow_s = slow_s
        self._state = VehicleState(
            id=name,
            mode="holding",
            pose=block.start,
            uncertainty=PoseUncertainty(horizontal_m=0.0, vertical_m=0.0, yaw_rad=0.0),
            battery=Battery(remaining=1.0),
            moves=0,
            path_m=0.0,
            path_horizontal_m=0.0,
            flight_s=0.0,
            collided=False,
        )
        self._sent: dict[int, Move] = {}
        self._flights: dict[int, asyncio.Task[MoveResult]] = {}
        self._stopping = False

    @property
    def name(self) -> str:
        return self._state.id

    @property
    def collided(self) -> bool:
        return self._state.collided

    @property
    def pose(self) -> Pose:
        return self._state.pose

    async def connect(self) -> VehicleCapabilities:
        return VehicleCapabilities(
            kind="block-world",
            cameras=self._rig.cameras,
            radius_m=RADIUS_M,
            max_speed_m_s=SPEED_M_S,
            cancels_moves=True,
            lands=True,
        )

    async def state(self) -> VehicleState:
        self._there()
        return self._state

    async def take_off(self, height_m: float) -> VehicleState:
        if self._state.mode == "landed":
            await self._by_itself("taking_off", [(self.pose.x, self.pose.y, self.pose.z + height_m)], "holding")
        return await self.state()

    async def observe(self, cameras: Sequence[str] | None = None, *, depth: bool = True) -> Observation:
        self._there()
        known = {camera.name: camera for camera in self._rig.cameras}
        names = list(known) if cameras is None else list(cameras)
        wrong = [name for name in names if name not in known]
        if wrong:
            raise ServiceRefused(f"there is no camera {wrong}; there are {list(known)}", code="bad_cameras", status=422)
        await asyncio.sleep(self._slow_s)
        while self._hovers():
            self._there()
            await asyncio.sleep(HOVER_S)
        self.looks += 1
        pose = self.pose
        views = []
        for camera in (known[name] for name in names):
            grey = encode_jpeg(np.full((camera.height, camera.width, 3), _shade(pose), np.uint8))
            seen = encode_depth(self.block.depth_m(pose, camera)) if depth else None
            views.append(SensedView(camera=camera, image=grey, depth=seen))
        return Observation(vehicle=self.name, number=self.looks, pose=pose, views=tuple(views))

    async def fly(self, number: int, move: Move, progress: Progress | None = None) -> MoveResult:
        self._there()
        flight = self._flights.get(number)
        if flight is None:
            self._must_be_next(number)
            flight = self._flights[number] = asyncio.create_task(self._flown(number, move, progress))
            self._sent[number] = move
        elif self._sent[number] != move:
            raise self._conflict(f"move {number} was sent with another body; the next is {self._state.moves + 1}")
        try:
            return await asyncio.shield(flight)
        except asyncio.CancelledError:
            await self.hold()
            raise

    async def hold(self) -> VehicleState:
        self._there()
        self.holds += 1
        self._stopping = True
        for flight in self._flights.values():
            with suppress(asyncio.CancelledError):
                await asyncio.shield(flight)
        self._stopping = False
        return self._state

    async def return_home(self) -> VehicleState:
        await self.hold()
        if self._state.mode != "landed":
            start, over = self.block.start, self.block.top + 3.0
            here = (self.pose.x, self.pose.y, over)
            corners = [here, (start.x, start.y, over), (start.x, start.y, start.z)]
            await self._by_itself("returning", corners, "holding")
        return self._state

    async def land(self) -> VehicleState:
        await self.hold()
        if self._state.mode != "landed":
            await self._by_itself("landing", [(self.pose.x, self.pose.y, -1.0)], "landed")
        return self._state

    async def release(self) -> None:
        if not self.released:
            await self.hold()
        self.released = True

    async def _flown(self, number: int, move: Move, progress: Progress | None) -> MoveResult:
        self._set(mode="moving", moves=number)
        corners = [self._place, *_places(move.path)]
        whole_m = max(1e-9, sum((math.dist(a, b) for a, b in pairwise(corners)), 0.0))
        flown_m, yaw, hit, cancelled = 0.0, self.pose.yaw, None, False

        def tell(state: str, share: float) -> None:
            if progress is not None:
                told = {"number": number, "state": state, "pose": self.pose, "share": min(1.0, share)}
                progress(MoveProgress.model_validate(told))

        rests_at = (*corners[-1][:2], corners[-1][2] - self._rests_below_m)
        for goal in [*corners[1:], *([rests_at] if self._rests_below_m else [])]:
            begin = self._place
            before_m = flown_m
            leg = await self._leg(goal, lambda m, so_far=before_m: tell("flying", 0.999 * (so_far + m) / whole_m))
            flown_m += leg.flown_m
            if math.dist(begin[:2], leg.end[:2]) > 0.01:
                yaw = math.atan2(leg.end[1] - begin[1], leg.end[0] - begin[0])
            hit, cancelled = leg.hit, leg.cancelled
            if hit or cancelled:
                break
        wanted = yaw if move.yaw is None or cancelled else math.remainder(move.yaw, math.tau)
        self._set(mode="holding", pose=self.pose.model_copy(update={"yaw": wanted}))
        self._set(collided=self._state.collided or hit is not None)
        tell("cancelled" if cancelled else "done", 1.0)
        return MoveResult(
            number=number,
            pose=self.pose,
            reached=hit is None and not cancelled,
            cancelled=cancelled,
            collided=hit is not None,
            hit=hit,
            path_m=flown_m,
            flight_s=flown_m / SPEED_M_S,
            vehicle=self._state,
        )

    async def _by_itself(self, doing: FlightMode, corners: Sequence[Place], then: FlightMode) -> None:
        self._set(mode=doing)
        for corner in corners:
            leg = await self._leg(corner, lambda _: None)
            if leg.hit or leg.cancelled:
                break
        self._set(mode=then)

    async def _leg(self, goal: Place, on_the_way: Callable[[float], None]) -> Leg:
        begin, flown_m, level_m = self._place, 0.0, 0.0
        steps = max(1, math.ceil(math.dist(begin, goal) / STEP_M))
        for k in range(1, steps + 1):
            if self._stopping:
                return Leg(self._place, flown_m, level_m, None, True)
            x, y, z = (a + (b - a) * k / steps for a, b in zip(begin, goal, strict=True))
            if self.block.distance(x, y, z) < RADIUS_M:
                return Leg(self._place, flown_m, level_m, "house", False)
            step_m, step_level_m = math.dist(self._place, (x, y, z)), math.dist(self._place[:2], (x, y))
            flown_m, level_m = flown_m + step_m, level_m + step_level_m
            self._advance(Pose(x=x, y=y, z=z, yaw=self.pose.yaw), step_m, step_level_m)
            on_the_way(flown_m)
            if self._pace:
                await asyncio.sleep(self._pace * step_m / SPEED_M_S)
        return Leg(self._place, flown_m, level_m, None, False)

    def _advance(self, pose: Pose, step_m: float, level_m: float) -> None:
        state = self._state
        flight_s = state.flight_s + step_m / SPEED_M_S
        self._set(
            pose=pose,
            path_m=state.path_m + step_m,
            path_horizontal_m=state.path_horizontal_m + level_m,
            flight_s=flight_s,
            battery=Battery(remaining=max(0.0, 1.0 - flight_s / ENDURANCE_S)),
        )

    @property
    def _place(self) -> Place:
        return self.pose.x, self.pose.y, self.pose.z

    def _set(self, **changes: object) -> None:
        self._state = self._state.model_copy(update=changes)

    def _must_be_next(self, number: int) -> None:
        if number != self._state.moves + 1:
            raise self._conflict(f"move {number} is out of order; the next is {self._state.moves + 1}")
        if self._state.mode != "holding":
            raise self._conflict(f"move {number} has to wait: the drone is {self._state.mode}")

    def _conflict(self, message: str) -> ServiceRefused:
        return ServiceRefused(f"block world: {message}", code="conflict", status=409)

    def _there(self) -> None:
        if self._away():
            raise ServiceUnreachable("block world: nobody answers")
        if self.released:
            raise ServiceRefused(f"block world: there is no vehicle {self.name}", code="not_found", status=404)


@dataclass
class BlockWorld:
    """A block as a Trial: begins drones and judges their claims by the block's thing. `boarded`: begun or resumed last.
    `ended`: the drones released, in the order in which they were begun; `begun_at`: when the last
    one was, in seconds since 1970. `away`: nobody answers; `hovers`: no drone ends a look, so that each that was begun
    stays in the air; `silent`: drones are flown, but tell nobody else how they stand."""

    block: Block = field(default_factory=Block)
    pace: float = 0.0
    slow_s: float = 0.0
    rests_below_m: float = 0.0
    vehicles: dict[str, BlockVehicle] = field(default_factory=dict)
    verdicts: dict[str, Verdict] = field(default_factory=dict)
    boarded: str = ""
    begun_at: float = 0.0
    away: bool = False
    hovers: bool = False
    silent: bool = False
    _by_key: dict[str, str] = field(default_factory=dict)

    @property
    def live(self) -> list[str]:
        return [name for name, vehicle in self.vehicles.items() if not vehicle.released]

    @property
    def ended(self) -> list[str]:
        return [name for name, vehicle in self.vehicles.items() if vehicle.released]

    @property
    def pose(self) -> Pose:
        """Of the drone boarded last."""
        return self.vehicles[self.boarded].pose

    async def begin(self, question: EpisodeQuestion) -> BlockVehicle:
        if any(o.kind == "unicorn" for o in question.scene.objects):
            raise ServiceRefused("sim: there is no class unicorn", code="unknown_class", status=422)
        assert question.key is not None
        key = question.key
        if key not in self._by_key:
            name = self._by_key[key] = f"e{len(self.vehicles) + 1}"
            self.begun_at = time.time()
            self.vehicles[name] = BlockVehicle(
                self.block,
                name,
                question.rig,
                pace=self.pace,
                slow_s=self.slow_s,
                rests_below_m=self.rests_below_m,
                away=lambda: self.away,
                hovers=lambda: self.hovers,
            )
        return await self.resume(self._by_key[key])

    async def resume(self, vehicle: str) -> BlockVehicle:
        if self.away:
            raise ServiceUnreachable("block world: nobody answers")
        found = self.vehicles.get(vehicle)
        if found is None or found.released:
            raise ServiceRefused(f"sim: there is no episode {vehicle}", code="not_found", status=404)
        self.boarded = vehicle
        return found

    async def renderer(self, vehicle: str) -> str | None:
        return "ray casting"

    async def claim(self, vehicle: str, target: Point3 | None) -> Verdict:
        if vehicle not in self.verdicts:
            self.verdicts[vehicle] = self._judged(await (await self.resume(vehicle)).state(), target)
        return self.verdicts[vehicle]

    def _judged(self, state: VehicleState, target: Point3 | None) -> Verdict:
        thing, normal, pose = self.block.thing, self.block.thing_normal, state.pose
        right = target is not None and math.dist((target.x, target.y, target.z), thing) < 1.0
        away = math.dist((pose.x, pose.y, pose.z), thing)
        front = (pose.x - thing[0]) * normal[0] + (pose.y - thing[1]) * normal[1] > 0
        return Verdict(
            judged=True,
            delivered=right and away <= 3.0 and front and not state.collided,
            right_window=right,
            distance_m=away,
            in_front=front,
            line_of_sight=True,
            collided=state.collided,
        )


def _shade(pose: Pose) -> int:
    """No two places look the same."""
    return round(1000.0 * (pose.x + 3.0 * pose.y + 7.0 * pose.z + 11.0 * pose.yaw)) % 251


def _places(path: Sequence[Point3]) -> list[Place]:
    return [(p.x, p.y, p.z) for p in path]
