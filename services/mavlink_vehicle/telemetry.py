"""What an autopilot was last heard to say, and where the vehicle was at each of the last moments."""

import math
import time
from bisect import bisect_left
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal, NamedTuple, get_args

from episode_kit.kinematics import wrapped
from services.mavlink_vehicle.frames import Enu

Clock = Callable[[], float]
Mode = Literal[
    "unknown",
    "ready",
    "takeoff",
    "hold",
    "mission",
    "return_to_launch",
    "land",
    "offboard",
    "follow_me",
    "manual",
    "altctl",
    "posctl",
    "acro",
    "stabilized",
    "rattitude",
]
MODES = frozenset(get_args(Mode))
"""MAVSDK's names. ArduCopter's GUIDED is `offboard` here, its LOITER `hold`."""
LOST_S = 2.0
"""Without a word for so long the link is lost."""
STALE_POSE_S = 1.0
KEPT_S = 3.0
WIDEST_GAP_S = 0.5
LEAP_M = 1.0
WORDS_COUNT_S = 20.0


class NoPose(Exception):
    """Where the vehicle was at that moment is not known; the message says why."""


class Timed(NamedTuple):
    """Where the vehicle was, in its own frame, at a moment of the clock."""

    time_s: float
    place: Enu


class PoseHistory:
    """The poses of the last seconds, oldest first."""

    def __init__(self) -> None:
        self._poses: deque[Timed] = deque()

    @property
    def last(self) -> Timed | None:
        return self._poses[-1] if self._poses else None

    @property
    def told_s(self) -> float:
        """When the last one came."""
        return self._poses[-1].time_s if self._poses else -math.inf

    @property
    def rate_hz(self) -> float:
        """How often one comes."""
        poses = self._poses
        return (len(poses) - 1) / max(1e-3, poses[-1].time_s - poses[0].time_s) if poses else 0.0

    def add(self, time_s: float, place: Enu) -> None:
        """One more; poses come in the order of their times."""
        self._poses.append(Timed(time_s, place))
        while self._poses[0].time_s < time_s - KEPT_S:
            self._poses.popleft()

    def at(self, time_s: float) -> Enu:
        """Between the poses before and after that moment; the last one a little after it. Raises NoPose."""
        if not self._poses:
            raise NoPose("the autopilot has not said where it is")
        last = self._poses[-1]
        if time_s >= last.time_s:
            if time_s - last.time_s > WIDEST_GAP_S:
                raise NoPose(f"the last position is {time_s - last.time_s:.1f} s older than the moment asked for")
            return last.place
        after = bisect_left(self._poses, time_s, key=lambda timed: timed.time_s)
        if after == 0:
            if self._poses[0].time_s == time_s:
                return self._poses[0].place
            raise NoPose(f"no position is kept of {last.time_s - time_s:.1f} s ago")
        return _between(self._poses[after - 1], self._poses[after], time_s)


def _between(a: Timed, b: Timed, time_s: float) -> Enu:
    if b.time_s - a.time_s > WIDEST_GAP_S:
        raise NoPose(f"no position was told for {b.time_s - a.time_s:.1f} s about that moment")
    share = (time_s - a.time_s) / (b.time_s - a.time_s)
    east_m, north_m, up_m = (p + (q - p) * share for p, q in zip(a.place[:3], b.place[:3], strict=True))
    return Enu(east_m, north_m, up_m, wrapped(a.place.yaw + wrapped(b.place.yaw - a.place.yaw) * share))


@dataclass
class Telemetry:
    """`armable` and `landed` are null until they were told; `remaining` is of a full battery. `leapt_m`: how far its
    position leapt in the air, faster than it flies; null where it has not since somebody looked. `missing`: what the
    estimate still lacks, for people."""

    clock: Clock = time.monotonic
    poses: PoseHistory = field(default_factory=PoseHistory)
    speed_m_s: float = 0.0
    leapt_m: float | None = None
    yaw: float | None = None
    mode: Mode = "unknown"
    mode_told_s: float = -math.inf
    armed: bool = False
    landed: bool | None = None
    armable: bool | None = None
    missing: tuple[str, ...] = ("a first report of its health",)
    remaining: float | None = None
    voltage_v: float | None = None
    home: Enu | None = None
    heard_s: float = -math.inf
    _words: deque[tuple[float, str]] = field(default_factory=lambda: deque(maxlen=4))

    def heard(self) -> None:
        """The autopilot is there."""
        self.heard_s = self.clock()

    def moved(self, place: Enu, speed_m_s: float) -> None:
        """Where it is; `place` has no heading of its own, which is told apart."""
        now, last = self.clock(), self.poses.last
        if last is not None and self.in_air:  # an estimate that settles while the vehicle stands leaps too
            gap_m = math.dist(place[:3], last.place[:3])
            if gap_m > LEAP_M + 2.0 * max(speed_m_s, self.speed_m_s) * (now - last.time_s):
                self.leapt_m = gap_m
        if self.yaw is not None:
            self.poses.add(now, place._replace(yaw=self.yaw))
        self.speed_m_s = speed_m_s

    def warned(self, words: str) -> None:
        """A warning or an error in the autopilot's words."""
        self._words.append((self.clock(), words))

    @property
    def silent_s(self) -> float:
        return self.clock() - self.heard_s

    @property
    def lost(self) -> bool:
        return self.silent_s > LOST_S

    @property
    def place(self) -> Enu | None:
        """Where it is now; null where that is not known."""
        last = self.poses.last
        return None if last is None or self.clock() - last.time_s > STALE_POSE_S else last.place

    @property
    def in_air(self) -> bool:
        return self.armed and self.landed is False

    @property
    def last_words(self) -> str:
        """The latest warning, in brackets; empty where there was none of late."""
        fresh = [words for said_s, words in self._words if self.clock() - said_s < WORDS_COUNT_S]
        return f" ({fresh[-1]})" if fresh else ""
