"""Where the camera hangs and which way it looks: as on a mission, nearer and farther, on and off the wall's normal."""

import math
from typing import NamedTuple

import numpy as np

from contracts.geometry import Pose
from contracts.scene_layout import facades, floor_outline, wall_height_m
from evaluation.scene_generator.footprints import distance_to_outline
from training.streets import Street

HEADINGS_DEG = (-90.0, -45.0, 0.0, 45.0, 90.0)
NEAREST_M = 2.4
_OFF_M = (3.0, 13.0)
_SQUARE_M = (6.0, 13.0)
_TURNS = 30


class CameraPose(NamedTuple):
    """One picture: from where, and towards which heading. `frontal`: squarely at a wall, as when floors are counted."""

    pose: Pose
    heading_deg: float
    frontal: bool


def looks(street: Street, stops: int, frontal: int, rng: np.random.Generator) -> list[CameraPose]:
    """Views from `stops` places before the street's walls (up to three each), and `frontal` square ones."""
    found: list[CameraPose] = []
    for number in range(stops):
        pose = _stop(street, street.walls[0] if number % 2 == 0 else int(rng.choice(street.walls)), rng)
        if pose is not None:
            found += [CameraPose(pose, h, False) for h in _headings(street, pose, rng)]
    return found + [_square(street, rng) for _ in range(frontal)]


def _stop(street: Street, wall_number: int, rng: np.random.Generator) -> Pose | None:
    target = street.scene.building(street.scene.target)
    floor = int(np.clip(street.floor + rng.integers(-1, 2), 1, target.floors))
    wall = facades(target, floor)[wall_number]
    outline = floor_outline(target, floor)
    facing = math.atan2(-wall.normal[1], -wall.normal[0])
    for _ in range(_TURNS):
        along = float(rng.uniform(0.0, wall.length_m))
        off = float(_OFF_M[0] + (_OFF_M[1] - _OFF_M[0]) * rng.beta(1.6, 1.8))
        x, y = (wall.start[i] + wall.along[i] * along + wall.normal[i] * off for i in (0, 1))
        if distance_to_outline((x, y), outline) < NEAREST_M:
            continue
        z = max(1.0, (floor - 0.5) * target.floor_height_m + float(rng.uniform(-1.4, 1.4)))
        turned = float(rng.choice((0.0, math.pi / 2), p=(0.4, 0.6)))
        return Pose(x=x, y=y, z=z, yaw=facing + turned + float(rng.uniform(-0.3, 0.3)))
    return None


def _headings(street: Street, pose: Pose, rng: np.random.Generator) -> list[float]:
    """The headings that look most squarely at the nearest wall, and now and then one that looks away."""
    target = street.scene.building(street.scene.target)
    best = min(facades(target), key=lambda f: abs(_off(f.start, f.normal, pose)) + 3 * _beside(f, pose))
    facing = math.atan2(-best.normal[1], -best.normal[0])

    def aside(heading: float) -> float:
        turn = pose.yaw - math.radians(heading) - facing
        return abs(math.atan2(math.sin(turn), math.cos(turn)))

    toward = [h for h in sorted(HEADINGS_DEG, key=aside) if aside(h) < math.radians(72)]
    chosen = toward[:2] if street.crowded else toward[:1]
    if rng.random() < (0.15 if street.crowded else 0.6):
        rest = [h for h in HEADINGS_DEG if h not in chosen]
        chosen = [*chosen, rest[int(rng.integers(len(rest)))]]
    return chosen


def _off(start: tuple[float, float], normal: tuple[float, float], pose: Pose) -> float:
    off = (pose.x - start[0]) * normal[0] + (pose.y - start[1]) * normal[1]
    return off if off > 0 else 100.0


def _beside(wall: object, pose: Pose) -> float:
    """Metres by which the pose lies beyond the wall's ends."""
    start, along, length = wall.start, wall.along, wall.length_m  # type: ignore[attr-defined]
    t = (pose.x - start[0]) * along[0] + (pose.y - start[1]) * along[1]
    return float(max(0.0, -t, t - length))


def _square(street: Street, rng: np.random.Generator) -> CameraPose:
    """Squarely before a wall, at a band's middle or at any height: where floors are counted."""
    target = street.scene.building(street.scene.target)
    outline = floor_outline(target, 1)
    # a wall in a court may have no room before it: then another, and the outer ones always have
    for number in (*rng.choice(street.walls, 8), *range(len(outline))):
        wall = facades(target)[int(number)]
        off = float(rng.uniform(*_SQUARE_M))
        slide = float(rng.uniform(-0.25, 0.25)) * wall.length_m
        x, y = (wall.start[i] + wall.along[i] * (wall.length_m / 2 + slide) + wall.normal[i] * off for i in (0, 1))
        if distance_to_outline((x, y), outline) >= NEAREST_M:
            break
    height = wall_height_m(target)
    bands = [off * (2 * k + 1) for k in range(math.ceil(height / (2 * off)))]
    z = float(rng.choice(bands))
    if rng.random() < 0.5:
        z = float(np.clip((street.floor - 0.5) * target.floor_height_m + rng.uniform(-4.0, 4.0), 1.2, height + 2.0))
    yaw = math.atan2(-wall.normal[1], -wall.normal[0]) + float(rng.normal(0.0, 0.03))
    return CameraPose(Pose(x=x, y=y, z=z, yaw=yaw), 0, True)
