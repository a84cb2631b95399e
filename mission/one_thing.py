"""What the boxes of one look say of one thing.

From near a model boxes parts of a thing as well, each for a thing of its own, and cameras that overlap each see it, the
one whole and the other cut off by the picture's edge. The place of a part is not that of the thing: half a metre aside
of a poster on the wall another window is the nearer one.
"""

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from contracts.geometry import Box
from contracts.vlm_gateway import Match
from mission.looks import Sight
from mission.places import distance_m
from mission.sighting import Sighting, box_depth_m
from navigation.camera import Camera

LARGEST_M = 2.2
"""Nothing that is asked for is wider or higher."""
TOUCHING = 0.4
"""Boxes that lie so near to each other touch: a share of the larger one's side."""
ONE_DEPTH_M = 0.6
ONE_PLACE_M = 1.0
"""Sightings of two cameras that lie so near to each other are of one thing."""
CUT_OFF = 0.005
"""So near to the picture's edge a box ends with the picture and not with the thing: a share of the picture."""


class _Boxed(NamedTuple):
    match: Match
    depth_m: float


def joined(matches: Iterable[Match], sight: Sight) -> list[Match]:
    """The matches of one picture, parts of one thing joined into one box, as sure as the surest of them.

    Boxes are parts of one thing where they touch, at one depth, and are no larger together than a thing can be. One
    without depth stays as it is."""
    found: list[Match] = []
    left: list[_Boxed] = []
    for match in sorted(matches, key=lambda m: -m.confidence):
        depth_m = box_depth_m(match.box, sight)
        if depth_m is None:
            found.append(match)
        else:
            left.append(_Boxed(match, depth_m))
    while left:
        whole, *left = left
        while (part := next((b for b in left if _is_part(b, whole, sight.camera)), None)) is not None:
            left.remove(part)
            box = _around(whole.match.box, part.match.box)
            whole = whole._replace(match=whole.match.model_copy(update={"box": box}))
        found.append(whole.match)
    return found


def clearest(sightings: Sequence[Sighting], one: Sighting) -> Sighting:
    """The sighting that shows the thing of `one` best: whole before cut off, in the middle of the picture before at its
    edge, where a picture is stretched. It tells the place, and how sure the look is: the surest of a thing's edges is
    no surer than the thing."""
    here = [s for s in sightings if s is one or _at_one_place(s, one)]
    return min(here, key=lambda s: (_is_cut_off(s.match.box), _off_middle(s.match.box)))


def _at_one_place(a: Sighting, b: Sighting) -> bool:
    return a.place is not None and b.place is not None and distance_m(a.place, b.place) <= ONE_PLACE_M


def _is_part(part: _Boxed, whole: _Boxed, camera: Camera) -> bool:
    if abs(part.depth_m - whole.depth_m) > ONE_DEPTH_M or not _touch(part.match.box, whole.match.box):
        return False
    both = _around(part.match.box, whole.match.box)
    wide_m = (both.x_max - both.x_min) * camera.width / camera.fx_px * whole.depth_m
    high_m = (both.y_max - both.y_min) * camera.height / camera.fy_px * whole.depth_m
    return max(wide_m, high_m) <= LARGEST_M


def _touch(a: Box, b: Box) -> bool:
    across = TOUCHING * max(a.x_max - a.x_min, b.x_max - b.x_min)
    down = TOUCHING * max(a.y_max - a.y_min, b.y_max - b.y_min)
    return (
        a.x_min - across < b.x_max
        and b.x_min - across < a.x_max
        and a.y_min - down < b.y_max
        and b.y_min - down < a.y_max
    )


def _around(a: Box, b: Box) -> Box:
    return Box(
        x_min=min(a.x_min, b.x_min),
        y_min=min(a.y_min, b.y_min),
        x_max=max(a.x_max, b.x_max),
        y_max=max(a.y_max, b.y_max),
    )


def _is_cut_off(box: Box) -> bool:
    return min(box.x_min, box.y_min) < CUT_OFF or max(box.x_max, box.y_max) > 1.0 - CUT_OFF


def _off_middle(box: Box) -> float:
    return math.hypot((box.x_min + box.x_max) / 2 - 0.5, (box.y_min + box.y_max) / 2 - 0.5)
