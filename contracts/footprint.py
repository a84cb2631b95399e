"""Whether a ground plan can be a building's: walls that meet at their corners and nowhere else."""

import math
from collections.abc import Sequence
from itertools import combinations

Corner = tuple[float, float]
"""Metres, ENU."""

LEAST_WALL_M = 0.2
"""Walls are at least this long, and at least this far apart where they are no neighbours."""
LEAST_ANGLE_DEG = 10.0
"""Between two neighbouring walls, inside or outside: mouldings that go round a sharper corner jut out for metres."""
LEAST_AREA_M2 = 1.0
_LEAST_SINE = math.sin(math.radians(LEAST_ANGLE_DEG))


def footprint_problem(corners: Sequence[Corner]) -> str | None:
    """What is wrong with a building's plan and what would be right; null where it is sound: an outline that runs
    counter-clockwise."""
    problem = outline_problem(corners)
    if problem is None and signed_area_m2(corners) < 0.0:
        return "the footprint runs clockwise; give its corners counter-clockwise"
    return problem


def outline_problem(corners: Sequence[Corner]) -> str | None:
    """The same of an outline, whichever way round it runs. Wall k goes from corner k to the next."""
    n = len(corners)
    walls = [(corners[k], corners[(k + 1) % n]) for k in range(n)]
    for k, (a, b) in enumerate(walls):
        if (length := math.dist(a, b)) < LEAST_WALL_M:
            return f"wall {k} is {length:.3g} m long; give each at least {LEAST_WALL_M:g} m, and no corner twice"
    for k, (a, b) in enumerate(walls):
        if _sharp(a, b, walls[(k + 1) % n][1]):
            return (
                f"the corner at ({b[0]:g}, {b[1]:g}) is sharper than {LEAST_ANGLE_DEG:g} degrees; leave the spike out "
                "or give it an end of its own"
            )
    for i, j in combinations(range(n), 2):
        neighbours = j - i in (1, n - 1)
        if not neighbours and (apart := _apart_m(*walls[i], *walls[j])) < LEAST_WALL_M:
            how = "cross or touch" if apart == 0.0 else f"are {apart:.3g} m apart"
            return (
                f"walls {i} and {j} {how}; walls meet at their common corners only and keep {LEAST_WALL_M:g} m apart "
                "elsewhere"
            )
    if (area_m2 := abs(signed_area_m2(corners))) < LEAST_AREA_M2:
        return f"{area_m2:.3g} m2 are enclosed; enclose at least {LEAST_AREA_M2:g} m2"
    return None


def signed_area_m2(corners: Sequence[Corner]) -> float:
    """Negative where the plan runs clockwise. Measured from one of its corners: exact far out as well."""
    walls = zip(corners, (*corners[1:], corners[0]), strict=True)
    x, y = corners[0]
    return sum((a[0] - x) * (b[1] - y) - (b[0] - x) * (a[1] - y) for a, b in walls) / 2


def _sharp(a: Corner, b: Corner, c: Corner) -> bool:
    """Whether a walker from a over b to c turns nearly round."""
    ux, uy, vx, vy = b[0] - a[0], b[1] - a[1], c[0] - b[0], c[1] - b[1]
    lengths = math.hypot(ux, uy) * math.hypot(vx, vy)
    return ux * vx + uy * vy < 0 and abs(ux * vy - uy * vx) < _LEAST_SINE * lengths


def _apart_m(a: Corner, b: Corner, c: Corner, d: Corner) -> float:
    """Between two straight walls, 0 where they cross."""
    if _side(a, b, c) * _side(a, b, d) < 0 and _side(c, d, a) * _side(c, d, b) < 0:
        return 0.0
    return min(_beside_m(c, a, b), _beside_m(d, a, b), _beside_m(a, c, d), _beside_m(b, c, d))


def _side(a: Corner, b: Corner, p: Corner) -> float:
    """Positive left of the line from a to b."""
    return (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])


def _beside_m(p: Corner, a: Corner, b: Corner) -> float:
    """From a point to the nearest place of a wall of some length."""
    ux, uy = b[0] - a[0], b[1] - a[1]
    t = ((p[0] - a[0]) * ux + (p[1] - a[1]) * uy) / (ux * ux + uy * uy)
    t = min(1.0, max(0.0, t))
    return math.dist(p, (a[0] + t * ux, a[1] + t * uy))
