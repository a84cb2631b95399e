"""What a mission carries through its phases: the ports, the log, the counts, and what it has learnt so far."""

import math
import time
from collections.abc import Awaitable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from contracts.cameras import Rig, default_rig
from contracts.depth_assist import ViewDepth
from contracts.event_data import EventData, MoveData, NoData, TurnData
from contracts.geometry import VIEW_HEADINGS_DEG, Box, Heading, Point3, Pose
from contracts.images import BadImage, DepthMap, decode_depth_units, decode_jpeg, depth_in_metres, jpeg_bytes
from contracts.orchestrator import MissionSettings, OutcomeName, Phase, Stop
from contracts.vehicle import Move, MoveResult, Observation, SensedView, VehicleState
from mission.asking import CallBook
from mission.ports import Ports, ServiceRefused
from mission.record import Log, Pictures
from mission.wording import with_article
from navigation.camera import Camera, DepthView, pinhole

T = TypeVar("T")


class MissionEnd(Exception):
    """The mission is over: its outcome, and why, for a person."""

    def __init__(self, outcome: OutcomeName, message: str) -> None:
        super().__init__(message)
        self.outcome = outcome
        self.message = message


class Size(NamedTuple):
    """Of a picture, in pixels."""

    width: int
    height: int


@dataclass(frozen=True)
class Sight:
    """One view of one moment, decoded when it is needed. Depth: (H, W) float32 metres along the optical axis, inf
    where nothing was hit, nan where invalid."""

    pose: Pose
    view: SensedView

    @property
    def heading_deg(self) -> Heading:
        return cast(Heading, int(self.view.camera.heading_deg))

    @cached_property
    def rgb(self) -> NDArray[np.uint8]:
        """(H, W, 3) uint8."""
        return decode_jpeg(self.view.image)

    @cached_property
    def depth_m(self) -> NDArray[np.float32]:
        return depth_in_metres(self._units, self._depth.metres_per_unit)

    def depth_row_m(self, row: int) -> NDArray[np.float32]:
        """(W,) one row of `depth_m`, where the rest of it is not needed."""
        return depth_in_metres(self._units[row], self._depth.metres_per_unit)

    @cached_property
    def _units(self) -> NDArray[np.uint16]:
        return decode_depth_units(self._depth)

    @property
    def _depth(self) -> DepthMap:
        if self.view.depth is None:
            raise ServiceRefused("the world sent a view without depth", code="garbled", status=502)
        return self.view.depth

    @property
    def size(self) -> Size:
        return Size(self._depth.width, self._depth.height)

    @property
    def camera(self) -> Camera:
        return pinhole(*self.size, 90.0, self.heading_deg)

    @property
    def seen(self) -> DepthView:
        """The depth with its camera, as the mathematics takes it."""
        return DepthView(self.camera, self.depth_m)

    @property
    def depth_view(self) -> ViewDepth:
        """The depth as it came, to be sent on."""
        return ViewDepth(heading_deg=self.heading_deg, depth=self._depth)

    @cached_property
    def jpeg(self) -> bytes:
        return jpeg_bytes(self.view.image)

    @property
    def name(self) -> str:
        return "view" if self.heading_deg == 0 else f"view{self.heading_deg:+d}"


@dataclass(frozen=True)
class Look:
    """All views of one moment."""

    observation: Observation
    sights: dict[Heading, Sight]

    @property
    def pose(self) -> Pose:
        return self.observation.pose

    def depth_beside(self, sight: Sight, reach_deg: int = 45) -> tuple[ViewDepth, ...]:
        """The depth of the views whose headings lie within `reach_deg` of that one's, without itself."""
        beside = (s for s in self.sights.values() if 0 < abs(s.heading_deg - sight.heading_deg) <= reach_deg)
        return tuple(s.depth_view for s in beside)

    @property
    def pictures(self) -> dict[str, bytes]:
        """The JPEG files, by a short name, as the record keeps them."""
        return {sight.name: sight.jpeg for sight in self.sights.values()}


@dataclass
class Sortie:
    """One delivery under way."""

    ports: Ports
    settings: MissionSettings
    log: Log
    book: CallBook = field(default_factory=CallBook)
    phase: Phase = "parse"
    rig: Rig = field(default_factory=default_rig)
    episode: VehicleState | None = None
    floor: int | None = None
    object: str | None = None
    final_height_m: float | None = None
    floor_height_m: float | None = None
    building_box: Box | None = None
    steps: int = 0
    exploration_steps: int = 0
    stops: list[Stop] = field(default_factory=list)
    ends: list[Pose] = field(default_factory=list)
    """Where each move ended."""
    _moves: int = 0
    _counted_at: int = -1

    @property
    def thing(self) -> str:
        """What is looked for, with its article, for a person."""
        return with_article(self.object or "object")

    @property
    def flown(self) -> VehicleState:
        """The vehicle after its last flight. Raises RuntimeError before it has been started."""
        if self.episode is None:
            raise RuntimeError("the drone has not been placed yet")
        return self.episode

    def write(self, message: str, data: EventData, pictures: Pictures | None = None) -> None:
        """One event of the phase under way."""
        self.log.write(self.phase, message, data, pictures)

    def enter(self, phase: Phase, message: str) -> None:
        """The next phase begins."""
        self.phase = phase
        self.write(message, NoData())

    def count_stop(self) -> None:
        """This stop carries a model query; several queries at the same place are one stop."""
        if self._counted_at != self._moves:
            self._counted_at = self._moves
            self.steps += 1
            self.stops.append(Stop(phase=self.phase, pose=self.flown.pose))

    async def timed(self, part: str, call: Awaitable[T]) -> T:
        """Awaits the call and adds its wall time to a part."""
        started = time.perf_counter()
        try:
            return await call
        finally:
            self.book.spend(part, time.perf_counter() - started)

    async def look(self, headings: tuple[Heading, ...] = VIEW_HEADINGS_DEG) -> Look:
        """One observation. Raises PortError; ServiceRefused as well where a picture is not what it says it is."""
        names = {camera.heading_deg: camera.name for camera in self.rig.cameras}
        wanted = [names[heading] for heading in headings]
        seen = await self.timed("observe", self.ports.world.observe(self.flown.id, wanted))
        sights = {sight.heading_deg: sight for sight in (Sight(seen.pose, view) for view in seen.views)}
        missing = [h for h in headings if h not in sights]
        try:
            for sight in sights.values():
                _ = sight.jpeg
        except BadImage as error:
            raise ServiceRefused(f"the world sent a bad picture: {error}", code="garbled", status=502) from None
        if missing:
            raise ServiceRefused(f"the world sent no view at {missing} degrees", code="garbled", status=502)
        return Look(seen, sights)

    async def fly(self, path: Sequence[Point3], yaw: float | None, why: str) -> MoveResult:
        """One move, recorded. Raises MissionEnd (collision) where the drone hit something, PortError."""
        self._moves += 1
        before = self.flown.pose
        move = Move(path=tuple(path), yaw=yaw)
        done = await self.timed("move", self.ports.world.move(self.flown.id, self._moves, move))
        self.episode = done.vehicle
        self.ends.append(done.pose)
        kind = MoveData if path else TurnData
        self.write(
            why + ("" if done.reached else f"; stopped early{f' by {done.hit}' if done.hit else ''}"),
            kind(
                number=done.number,
                start=before,
                to=done.pose,
                path=tuple(path),
                reached=done.reached,
                collided=done.collided,
                hit=done.hit,
                path_m=round(done.path_m, 3),
                flight_s=round(done.flight_s, 3),
            ),
        )
        if done.collided or done.vehicle.collided:
            hit = f" with {done.hit}" if done.hit else ""
            raise MissionEnd("collision", f"the drone collided{hit} at {spoken(done.pose)} ({why})")
        return done


def spoken(place: Pose | Point3) -> str:
    return f"({place.x:.1f}, {place.y:.1f}, {place.z:.1f})"


def towards(heading_deg: Heading) -> str:
    """A view's heading, for a person."""
    return "ahead" if heading_deg == 0 else f"{abs(heading_deg)}° {'right' if heading_deg > 0 else 'left'}"


def ahead(pose: Pose, bearing_deg: float, distance_m: float) -> Point3:
    """The point at that bearing (degrees from the nose, positive to the right) and distance, at the same height."""
    angle = pose.yaw - math.radians(bearing_deg)
    return Point3(x=pose.x + distance_m * math.cos(angle), y=pose.y + distance_m * math.sin(angle), z=pose.z)


def above(pose: Pose, z: float) -> Point3:
    """The point at height `z` (metres) straight above or below the pose."""
    return Point3(x=pose.x, y=pose.y, z=z)


def distance_m(a: Pose | Point3, b: Pose | Point3) -> float:
    return math.dist((a.x, a.y, a.z), (b.x, b.y, b.z))
