"""Where the movers of a scene are, by the clock: pure functions of the document and of seconds."""

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from contracts.scene import Scene
from contracts.scene_traffic import Bird, Mover, Person
from services.sim.geometry.street import KERB_M, pavement_of

F64 = NDArray[np.float64]
AXLE_M = 1.3
"""From the middle of a car to each of its axles, both of which stay on its way."""
WINGS_M = 1.5
"""Over so much of its way before and behind it a bird rounds its corners."""
PERSON_RADIUS_M = 0.3
CAR_HALF_M = (2.15, 0.9, 0.725)
BIRD_BERTH_M = 2.5
"""No bird comes nearer to a drone's centre."""
_KERB_STEP_M = 0.2


class Polyline:
    """points (K, 2) or (K, 3) metres; lengths are those on the plan. Past its ends it goes on straight."""

    def __init__(self, points: ArrayLike, *, closed: bool = False) -> None:
        p = np.asarray(points, np.float64)
        self._points = np.vstack([p, p[:1]]) if closed else p
        self._closed = closed
        legs = np.hypot(*np.diff(self._points[:, :2], axis=0).T)
        self._at = np.concatenate([[0.0], np.cumsum(legs)])

    @property
    def length_m(self) -> float:
        return float(self._at[-1])

    def along(self, distance_m: F64) -> F64:
        """(T, 2 or 3) at distances (T,) from the first point."""
        s = np.mod(distance_m, self.length_m) if self._closed else distance_m
        leg = np.clip(np.searchsorted(self._at, s, side="right") - 1, 0, len(self._at) - 2)
        a, b = self._points[leg], self._points[leg + 1]
        share = (s - self._at[leg]) / (self._at[leg + 1] - self._at[leg])
        return np.asarray(a + (b - a) * share[:, None])


class Course:
    """One mover's way in time. Immutable."""

    def __init__(self, mover: Mover, pavement: shapely.Geometry) -> None:
        self.mover = mover
        self._kerbs: tuple[F64, F64] | None = None
        if isinstance(mover, Bird):
            self._way = Polyline([(p.x, p.y, p.z) for p in mover.way], closed=True)
        else:
            self._way = Polyline([(p.x, p.y) for p in mover.way])
            self._kerbs = _heights(self._way, pavement)

    def travelled(self, time_s: F64) -> F64:
        """(T,) metres since the start of its first round."""
        rounds = 2.0 if isinstance(self.mover, Person) else 1.0
        return np.asarray(self.mover.phase * rounds * self._way.length_m + self.mover.speed_m_s * time_s)

    def at(self, time_s: ArrayLike) -> F64:
        """(T, 4) x, y, z of what is lowest of it (of a bird: its middle) and its heading, at seconds (T,)."""
        gone = self.travelled(np.atleast_1d(np.asarray(time_s, np.float64)))
        if isinstance(self.mover, Person):
            return self._walking(gone)
        half = WINGS_M if isinstance(self.mover, Bird) else AXLE_M
        s = np.mod(gone, self._way.length_m)
        front, rear = self._way.along(s + half), self._way.along(s - half)
        place, ahead = (front + rear) / 2.0, front - rear
        z = place[:, 2] if self._kerbs is None else self._kerb(s)
        return np.column_stack([place[:, :2], z, np.arctan2(ahead[:, 1], ahead[:, 0])])

    def _walking(self, gone: F64) -> F64:
        length = self._way.length_m
        s = np.mod(gone, 2.0 * length)
        back = s > length
        s = np.where(back, 2.0 * length - s, s)
        place = self._way.along(s)
        ahead = self._way.along(np.minimum(s + 0.2, length)) - self._way.along(np.maximum(s - 0.2, 0.0))
        ahead = np.where(back[:, None], -ahead, ahead)
        return np.column_stack([place, self._kerb(s), np.arctan2(ahead[:, 1], ahead[:, 0])])

    def _kerb(self, s: F64) -> F64:
        assert self._kerbs is not None
        return np.interp(s, *self._kerbs)

    def clearance_m(self, places: F64, time_s: F64) -> F64:
        """(T,) metres from places (T, 3) to its surface at those times, negative inside; a bird is never near."""
        mover = self.mover
        if isinstance(mover, Bird):
            return np.full(len(places), np.inf)
        here = self.at(time_s)
        round_m = PERSON_RADIUS_M if isinstance(mover, Person) else 0.0
        half = (0.0, 0.0, mover.height_m / 2.0 - round_m) if isinstance(mover, Person) else CAR_HALF_M
        gap = places - here[:, :3] - (0.0, 0.0, half[2] + round_m)
        c, s = np.cos(here[:, 3]), np.sin(here[:, 3])
        beside = np.abs(np.column_stack([c * gap[:, 0] + s * gap[:, 1], c * gap[:, 1] - s * gap[:, 0], gap[:, 2]]))
        beyond = beside - half
        outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
        return np.asarray(outside + np.minimum(beyond.max(axis=1), 0.0) - round_m)


def courses_of(scene: Scene) -> tuple[Course, ...]:
    """In the document's order."""
    pavement = pavement_of(scene.ground.roads)
    return tuple(Course(mover, pavement) for mover in scene.traffic)


def made_way(place: F64, drone: F64) -> F64:
    """(3,) where a bird flies that would come too near to a drone: straight away from it."""
    gap = place - drone
    near_m = float(np.linalg.norm(gap))
    if near_m >= BIRD_BERTH_M:
        return place
    away = gap / near_m if near_m > 1e-6 else np.array((0.0, 0.0, 1.0))
    return np.asarray(drone + away * BIRD_BERTH_M)


def _heights(way: Polyline, pavement: shapely.Geometry) -> tuple[F64, F64]:
    """Distances along the way, and how high the ground is there."""
    s = np.arange(0.0, way.length_m + _KERB_STEP_M, _KERB_STEP_M)
    x, y = way.along(np.minimum(s, way.length_m)).T
    return s, np.where(shapely.contains_xy(pavement, x, y), KERB_M, 0.0)
