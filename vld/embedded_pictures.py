"""Labelled pictures of random scenes, rendered by the simulator over HTTP: what the embedded model is fitted to.

`python -m vld.embedded_pictures --out DIRECTORY --first 0 --count 60 [--stops 5] [--sim URL]`

Seeds 0-99,999 are for fitting and trying out. Each scene is crowded with things, seen from stops on a ring about the
building at the goal's height, and squarely from the middles of the bands in which floors are counted.
"""

import argparse
import math
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np

from contracts.geometry import VIEW_HEADINGS_DEG, Heading, Point3
from contracts.images import jpeg_bytes
from contracts.labelled import LABELS_FILE, LabelledView
from contracts.scene import Scene
from contracts.scene_layout import facades, floor_outline, wall_height_m
from contracts.sim import Catalogue, Move, TruthQuestion
from vld.footprints import distance_to_outline
from vld.random_specs import random_spec
from vld.scenes import build_scene
from vld.sim_client import SimClient, SimulatorFault, own_simulator

_STAND_OFF_M = (5.5, 10.5)
_SQUARE_M = (8.0, 10.0)
_CLEAR_M = 4.0
_CROWD = 110
_ABOVE_M = 12.0
_YAW_JITTER = 0.25


class Stop(NamedTuple):
    """Where to look from, metres and radians; `frontal` stops look squarely and ahead only."""

    x: float
    y: float
    z: float
    yaw: float
    frontal: bool


def ring_stops(scene: Scene, count: int, rng: np.random.Generator) -> list[Stop]:
    """Stops at the goal's height, each before a facade; half of them have the building on the right, as on a lap."""
    target = scene.building(scene.target)
    goal = next(o for o in scene.objects if o.id == scene.goal)
    floor = goal.place.floor if goal.place.at == "window" else 1
    outline = floor_outline(target, 1)
    stops: list[Stop] = []
    for _ in range(count * 20):
        if len(stops) == count:
            break
        wall = facades(target)[int(rng.integers(len(outline)))]
        along, off = float(rng.uniform(-3, wall.length_m + 3)), float(rng.uniform(*_STAND_OFF_M))
        x, y = (wall.start[i] + wall.along[i] * along + wall.normal[i] * off for i in (0, 1))
        if not _CLEAR_M <= distance_to_outline((x, y), outline) <= _STAND_OFF_M[1]:
            continue
        z = (floor - 0.5) * target.floor_height_m + float(rng.uniform(-0.8, 0.8))
        facing = math.atan2(-wall.normal[1], -wall.normal[0])
        yaw = facing + (math.pi / 2 if rng.random() < 0.5 else 0.0) + float(rng.uniform(-_YAW_JITTER, _YAW_JITTER))
        stops.append(Stop(x, y, max(1.0, z), yaw, False))
    return stops


def frontal_stops(scene: Scene, rng: np.random.Generator) -> list[Stop]:
    """Before the starting facade, at the middles of the bands up the wall: z = d, 3d, 5d, ... (d the stand-off)."""
    target = scene.building(scene.target)
    start = scene.start
    wall = max(facades(target), key=lambda f: -(f.normal[0] * math.cos(start.yaw) + f.normal[1] * math.sin(start.yaw)))
    off = float(rng.uniform(*_SQUARE_M))
    slide = float(rng.uniform(-0.2, 0.2)) * wall.length_m
    middle = [wall.start[i] + wall.along[i] * (wall.length_m / 2 + slide) + wall.normal[i] * off for i in (0, 1)]
    bands = math.ceil(wall_height_m(target) / (2 * off))
    heights = [off * (2 * k + 1) for k in range(bands)] + [float(rng.uniform(1.2, wall_height_m(target)))]
    return [Stop(middle[0], middle[1], z, start.yaw, True) for z in heights]


def picture_scene(simulator: SimClient, scene: Scene, stops: list[Stop], out: Path, size: int) -> list[LabelledView]:
    """Flies to each stop over the roofs and writes what is seen there. Raises SimulatorFault."""
    top = max(wall_height_m(b) for b in scene.buildings) + _ABOVE_M
    episode = simulator.open(scene)
    try:
        at = episode.pose
        labelled = []
        for number, stop in enumerate(stops, start=1):
            corners = [(at.x, at.y, top), (stop.x, stop.y, top), (stop.x, stop.y, stop.z)]
            path = tuple(Point3(x=x, y=y, z=z) for x, y, z in corners)
            at = simulator.move(episode.id, number, Move(path=path, yaw=stop.yaw)).pose
            views: tuple[Heading, ...] = (0,) if stop.frontal else VIEW_HEADINGS_DEG
            seen = simulator.observe(episode.id, views, size)
            truth = simulator.truth(episode.id, TruthQuestion(views=views, size=size))
            for view, known in zip(seen.views, truth.views, strict=True):
                name = f"{scene.name}-{number}-{view.heading_deg}.jpg"
                (out / name).write_bytes(jpeg_bytes(view.image))
                labelled.append(
                    LabelledView(
                        picture=name,
                        scene=scene.name,
                        seed=scene.seed,
                        frontal=stop.frontal,
                        pose=seen.pose,
                        truth=known,
                    )
                )
        return labelled
    finally:
        simulator.close(episode.id)


def crowded(catalogue: Catalogue, seed: int) -> Scene:
    """A random scene with far more things at its windows than a delivery would meet."""
    spec = random_spec(catalogue, seed)
    return build_scene(spec.model_copy(update={"clutter": _CROWD}), seed, catalogue)


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(prog="python -m vld.embedded_pictures", description="Render labelled pictures.")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--stops", type=int, default=5)
    parser.add_argument("--size", type=int, default=800)
    parser.add_argument("--plain", action="store_true", help="no crowd: scenes as deliveries meet them")
    parser.add_argument("--sim", help="address of a running simulator; without it one is started")
    chosen = parser.parse_args(arguments)
    if chosen.sim:
        _render(SimClient(chosen.sim), chosen)
    else:
        with own_simulator() as simulator:
            _render(simulator, chosen)
    return 0


def _render(simulator: SimClient, chosen: argparse.Namespace) -> None:
    chosen.out.mkdir(parents=True, exist_ok=True)
    catalogue = simulator.catalogue()
    (chosen.out / "catalogue.json").write_text(catalogue.model_dump_json(indent=1), encoding="utf-8")
    with (chosen.out / LABELS_FILE).open("a", encoding="utf-8") as labels:
        for seed in range(chosen.first, chosen.first + chosen.count):
            rng = np.random.default_rng((seed, 7))
            scene = (
                build_scene(random_spec(catalogue, seed), seed, catalogue) if chosen.plain else crowded(catalogue, seed)
            )
            stops = ring_stops(scene, chosen.stops, rng) + frontal_stops(scene, rng)
            try:
                views = picture_scene(simulator, scene, stops, chosen.out, chosen.size)
            except SimulatorFault as error:
                sys.stderr.write(f"seed {seed} left out: {error}\n")
                continue
            labels.writelines(view.model_dump_json() + "\n" for view in views)
            labels.flush()
            sys.stdout.write(f"seed {seed}: {len(views)} pictures\n")
            sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
