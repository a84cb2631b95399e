"""Ground plans as polygons, and how many corners lie between two of their facades.

Plans run counter-clockwise seen from above, so that a clockwise lap (building on the drone's right) meets the facades
in falling order.
"""

import math
from typing import Literal

from contracts.geometry import Point2
from evaluation.scene_generator.scene_plan import Difficulty, FootprintSpec
from navigation.polygon import inside

Corner = tuple[float, float]


def outline(spec: FootprintSpec) -> tuple[Corner, ...]:
    """The plan's corners in metres about the middle of its bounding box; facade 0 is its south side."""
    w, d, a = spec.width_m, spec.depth_m, spec.arm_m
    left, right = (w - a) / 2, (w + a) / 2
    front, back = (d - a) / 2, (d + a) / 2
    corners: tuple[Corner, ...]
    if spec.shape == "rectangle":
        corners = ((0, 0), (w, 0), (w, d), (0, d))
    elif spec.shape == "l":
        corners = ((0, 0), (w, 0), (w, a), (a, a), (a, d), (0, d))
    elif spec.shape == "u":
        corners = ((0, 0), (w, 0), (w, d), (w - a, d), (w - a, a), (a, a), (a, d), (0, d))
    elif spec.shape == "t":
        corners = ((0, 0), (w, 0), (w, a), (right, a), (right, d), (left, d), (left, a), (0, a))
    elif spec.shape == "plus":
        corners = (
            *((left, 0.0), (right, 0.0), (right, front), (w, front), (w, back), (right, back)),
            *((right, d), (left, d), (left, back), (0.0, back), (0.0, front), (left, front)),
        )
    else:
        r = w / 2 / math.cos(math.pi / 8)
        turns = [math.radians(-112.5 + 45 * k) for k in range(8)]
        return tuple((r * math.cos(t), r * math.sin(t)) for t in turns)
    return tuple((x - w / 2, y - d / 2) for x, y in corners)


def corners_between(
    facade_count: int,
    start: int,
    target: int,
    direction: Literal["shorter", "clockwise", "counterclockwise"] = "shorter",
) -> int:
    """How many corners of the plan lie between two facades, the shorter way round or one given way.

    Raises ValueError for a facade the plan hasn't got.
    """
    if not (0 <= start < facade_count and 0 <= target < facade_count):
        raise ValueError(f"the plan has facades 0..{facade_count - 1}, not {start} and {target}")
    clockwise = (start - target) % facade_count
    counterclockwise = (target - start) % facade_count
    if direction == "clockwise":
        return clockwise
    if direction == "counterclockwise":
        return counterclockwise
    return min(clockwise, counterclockwise)


def difficulty_of(corners: int) -> Difficulty:
    """The paper's classes: fewer than 2 turns easy, 2 to 3 moderate, more than 3 hard."""
    if corners < 2:
        return "easy"
    return "moderate" if corners <= 3 else "hard"


def distance_to_outline(point: Corner, corners: tuple[Corner, ...]) -> float:
    """Metres from a point to the plan's walls; 0 inside."""
    if inside([point], corners)[0]:
        return 0.0
    return min(_to_segment(point, a, b) for a, b in zip(corners, corners[1:] + corners[:1], strict=True))


def outlines_gap(first: tuple[Corner, ...], second: tuple[Corner, ...]) -> float:
    """Metres between two plans that don't cross; 0 where a corner of one lies inside the other."""
    return min(
        min(distance_to_outline(p, second) for p in first),
        min(distance_to_outline(p, first) for p in second),
    )


def rotated(corner: Corner, angle: float) -> Corner:
    """Turned about the origin, radians counter-clockwise."""
    c, s = math.cos(angle), math.sin(angle)
    return (c * corner[0] - s * corner[1], s * corner[0] + c * corner[1])


def points(corners: tuple[Corner, ...], angle: float = 0.0) -> tuple[Point2, ...]:
    """As the scene document's points, rounded to the millimetre."""
    turned = (rotated(c, angle) for c in corners)
    return tuple(Point2(x=round(x, 3), y=round(y, 3)) for x, y in turned)


def _to_segment(p: Corner, a: Corner, b: Corner) -> float:
    dx, dy = b[0] - a[0], b[1] - a[1]
    t = max(0.0, min(1.0, ((p[0] - a[0]) * dx + (p[1] - a[1]) * dy) / (dx * dx + dy * dy)))
    return math.hypot(p[0] - a[0] - t * dx, p[1] - a[1] - t * dy)
