"""From a match in a picture to a place in the street, and back: by depth, never by what a model says of distances."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from contracts.geometry import Box, Point3
from contracts.geometry import Pose as WirePose
from contracts.vlm_gateway import Match
from mission.looks import Look, Sight
from mission.places import distance_m
from mission.stages import Extent
from mission.state import Dismissed
from navigation import target
from navigation.camera import Pose, pixel_place, pixels_of

TARGET = target.TargetParameters()
MAX_SIGHTING_M = 25.0
SAME_FLOOR = 0.75
FACADE_SAMPLES = 24
SAME_PLACE_M = 1.5
OTHER_SIDE_DEG = 30.0
SURER_BY = 0.1
MAX_TRIES = 2


class Sighting(NamedTuple):
    """A match with its place. `rejected` says why it can't be the window that was asked for; null if it can.
    `place`, `distance_m` and `extent` are null where the box holds no depth."""

    match: Match
    place: Point3 | None
    distance_m: float | None
    extent: Extent | None
    rejected: str | None


def is_dismissed(
    dismissed: Sequence[Dismissed], place: Point3, pose: WirePose, confidence: float, *, claimable: bool
) -> bool:
    """Was that thing looked at from near before, and is not worth another look?"""
    near = [d for d in dismissed if distance_m(place, d.place) < SAME_PLACE_M]
    return len(near) >= MAX_TRIES or any(_holds(d, pose, confidence, claimable=claimable) for d in near)


def _holds(dismissed: Dismissed, pose: WirePose, confidence: float, *, claimable: bool) -> bool:
    """Is a thing at that place still dismissed? From another side, or seen more surely than before, it may be what was
    asked for; but only a sighting that could be claimed as it stands is followed."""
    if not claimable:
        return True
    if confidence >= dismissed.confidence + SURER_BY:
        return False
    place, seen_from = dismissed.place, dismissed.seen_from
    before = math.atan2(seen_from.y - place.y, seen_from.x - place.x)
    now = math.atan2(pose.y - place.y, pose.x - place.x)
    return abs(math.remainder(now - before, math.tau)) < math.radians(OTHER_SIDE_DEG)


def box_depth_m(box: Box, sight: Sight) -> float | None:
    """Planar depth of the thing in the box, metres; null where the box holds none."""
    return target.box_depth_m(sight.seen, target.Box(box.x_min, box.y_min, box.x_max, box.y_max), TARGET)


def locate(match: Match, sight: Sight, *, floor_z: float, floor_height_m: float) -> Sighting:
    """Judges a match by the depth in its box.

    The place is worked out where the approach works it out, in `navigation.target`. It must have depth, lie within
    `MAX_SIGHTING_M`, and within `SAME_FLOOR` floors of `floor_z`, the middle of the floor that was asked for (metres).
    """
    box = target.Box(match.box.x_min, match.box.y_min, match.box.x_max, match.box.y_max)
    depth_m = box_depth_m(match.box, sight)
    at = target.box_place(sight.seen, box, _pose(sight), TARGET)
    if depth_m is None or at is None:
        return Sighting(match, None, None, None, "no depth in its box")
    camera = sight.camera
    width, height = camera.width, camera.height
    extent = Extent(
        (box.x_max - box.x_min) * width * depth_m / camera.fx_px,
        (box.y_max - box.y_min) * height * depth_m / camera.fy_px,
    )
    away = math.dist(at, (sight.pose.x, sight.pose.y, sight.pose.z))
    rejected = None
    if away > MAX_SIGHTING_M:
        rejected = f"{away:.1f} m away, too far to be sure"
    elif abs(at.z - floor_z) > SAME_FLOOR * floor_height_m:
        rejected = f"at height {at.z:.1f} m, not on the floor asked for (about {floor_z:.1f} m)"
    return Sighting(match, Point3(x=at.x, y=at.y, z=at.z), away, extent, rejected)


def project(place: Point3, extent: Extent, look: Look) -> tuple[Sight, Box] | None:
    """Where a thing of that extent must be in one of the views, as far as it lies in the picture; the view in which
    it is nearest to the middle. Null where it is in none of them."""
    best: tuple[float, Sight, Box] | None = None
    for sight in look.all:
        camera = sight.camera
        x_px, y_px, ahead = (
            float(v[0]) for v in pixels_of(camera, _pose(sight), np.array([[place.x, place.y, place.z]]))
        )
        if ahead < 0.1:
            continue
        x, y = x_px / camera.width, y_px / camera.height
        half_x = extent.width_m / ahead * camera.fx_px / camera.width / 2
        half_y = extent.height_m / ahead * camera.fy_px / camera.height / 2
        edges = [min(1.0, max(0.0, e)) for e in (x - half_x, y - half_y, x + half_x, y + half_y)]
        if not (0.0 < x < 1.0 and 0.0 < y < 1.0) or edges[2] - edges[0] < 0.005 or edges[3] - edges[1] < 0.005:
            continue
        off = abs(x_px - camera.cx_px) / camera.fx_px
        if best is None or off < best[0]:
            best = (off, sight, Box(x_min=edges[0], y_min=edges[1], x_max=edges[2], y_max=edges[3]))
    return best[1:] if best else None


def facade_returns(sights: Sequence[Sight]) -> list[tuple[float, float]]:
    """Where the middle rows of some views hit something: plan points in metres, for drawing only."""
    points = []
    for sight in sights:
        camera = sight.camera
        row = sight.depth_row_m(int(camera.cy_px))
        for column in np.linspace(0, camera.width - 1, FACADE_SAMPLES).astype(int):
            depth = float(row[column])
            if math.isfinite(depth) and 0.0 < depth < 40.0:
                at = pixel_place(camera, column + 0.5, camera.cy_px, depth, _pose(sight))
                points.append((round(at.x, 2), round(at.y, 2)))
    return points


def _pose(sight: Sight) -> Pose:
    return Pose(sight.pose.x, sight.pose.y, sight.pose.z, sight.pose.yaw)
