"""Renders the streets of the evaluation, each once: what a mission sees on its lap, before the window, and while it
counts floors."""

import math
import zlib
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np

from contracts.cameras import default_rig
from contracts.geometry import Pose
from contracts.images import DepthMap, decode_depth, jpeg_bytes
from contracts.scene_layout import wall_height_m
from contracts.sim import Catalogue
from contracts.vehicle import Observation
from evaluation.model_evaluation.cases import (
    CASES_FILE,
    CATALOGUE_FILE,
    STRANGE_SEED,
    Case,
    Front,
    RenderedLook,
    Street,
    read_cases,
    street,
)
from evaluation.scene_generator.scene_plan import UnbuildableScene
from evaluation.sim_client import SimClient
from evaluation.subtasks.stage import Stage, staged
from evaluation.subtasks.stops import Stop, before_goal, is_clear, on_lap
from navigation import facade
from navigation.camera import DepthView, pinhole
from navigation.floor_localization import VerticalView, band, band_span_m

NEAR_M, FAR_M = (3.5, 10.0), (10.0, 20.0)
FRONT_VIEW = VerticalView(1.0, 1.0)
"""Of paper-five's front camera: 90 degrees down as across."""
STEP_BACK_M, STEPS_BACK = 12.0, 3
_FACADE = facade.FacadeParameters()


def render(
    seeds: Iterable[int], folder: Path, simulator: SimClient, told: Callable[[int], None] | None = None
) -> dict[int, Case]:
    """The cases of the seeds, those that are missing in the folder rendered first; `told` hears each seed when its case
    is there. A seed without a buildable street has no case. Raises evaluation.sim_client.SimulatorFault, OSError."""
    folder.mkdir(parents=True, exist_ok=True)
    cases = read_cases(folder)
    catalogue = simulator.catalogue()
    (folder / CATALOGUE_FILE).write_text(catalogue.model_dump_json(), encoding="utf-8")
    wanted: dict[int, Case] = {}
    with (folder / CASES_FILE).open("a", encoding="utf-8") as lines:
        if lines.tell():
            lines.write("\n")  # after a line that a crash cut off
        for seed in seeds:
            case = cases.get(seed)
            if case is None:
                case = _rendered(seed, catalogue, folder, simulator)
                if case is not None:
                    lines.write(case.model_dump_json() + "\n")
                    lines.flush()
            if case is not None:
                wanted[seed] = case
            if told is not None:
                told(seed)
    return wanted


def _rendered(seed: int, catalogue: Catalogue, folder: Path, simulator: SimClient) -> Case | None:
    try:
        shown = street(seed, catalogue)
    except UnbuildableScene:
        return None
    rng = np.random.default_rng((seed, zlib.crc32(b"evaluation")))
    (folder / f"{seed}").mkdir(exist_ok=True)
    with staged(simulator, shown.scene, default_rig()) as stage:
        looks = _looks(seed, shown, stage, folder, rng)
        fronts = _fronts(seed, shown, stage, folder)
    target = shown.scene.building(shown.scene.target)
    return Case(
        seed=seed,
        object=shown.object,
        kind=shown.kind,
        colour=shown.colour,
        floor=shown.floor,
        floors=target.floors,
        floor_height_m=shown.floor_height_m,
        building=target.kind,
        wall=target.style.wall,
        sky=shown.scene.light.sky,
        exposure=shown.scene.light.exposure,
        strange=seed >= STRANGE_SEED,
        looks=tuple(looks),
        fronts=tuple(fronts),
    )


def _looks(seed: int, shown: Street, stage: Stage, folder: Path, rng: np.random.Generator) -> list[RenderedLook]:
    """On the lap, then before the goal from afar and from near: the order in which a mission meets them."""
    stops = [("lap", stop) for stop in on_lap(shown, 1, rng)]
    stops += [("far", stop) for stop in before_goal(shown, 1, rng, FAR_M)]
    stops += [("near", stop) for stop in before_goal(shown, 1, rng, NEAR_M)]
    looks = []
    for where, stop in stops:
        if not stage.go(stop):
            continue
        seen, truth = stage.look(), stage.truth()
        cameras = tuple(view.camera for view in seen.views)
        names = tuple(f"{seed}/{where}-{camera.name}.jpg" for camera in cameras)
        for name, view in zip(names, seen.views, strict=True):
            (folder / name).write_bytes(jpeg_bytes(view.image))
        looks.append(
            RenderedLook.model_validate(
                {"where": where, "pose": seen.pose, "cameras": cameras, "pictures": names, "truth": truth}
            )
        )
    return looks


def _fronts(seed: int, shown: Street, stage: Stage, folder: Path) -> list[Front]:
    """Every band of eq. 3 up to the roof, and one picture of the whole building from farther away."""
    start = shown.scene.start
    top_m = wall_height_m(shown.scene.building(shown.scene.target))
    if not stage.go(Stop(start.position.x, start.position.y, start.position.z, start.yaw)):
        return []
    stand_off = _stand_off(stage.look(stage.front, depth=True))
    if stand_off is None:
        return []
    span = band_span_m(stand_off, FRONT_VIEW)
    fronts = []
    for number in range(1, math.ceil(top_m / span) + 1):
        camera_m = band(number, span).camera_m
        if not stage.go(Stop(start.position.x, start.position.y, camera_m, start.yaw)):
            break
        fronts.append(_front(seed, number, stand_off, stage, folder))
    for steps in range(1, STEPS_BACK + 1):
        away = stand_off + steps * STEP_BACK_M
        x = start.position.x - steps * STEP_BACK_M * math.cos(start.yaw)
        y = start.position.y - steps * STEP_BACK_M * math.sin(start.yaw)
        if not is_clear(shown.scene, x, y):
            break
        if (top_m > 2 * away and steps < STEPS_BACK) or not stage.go(Stop(x, y, away, start.yaw)):
            continue
        fronts.append(_front(seed, 0, away, stage, folder))
        break
    return fronts


def _front(seed: int, number: int, stand_off: float, stage: Stage, folder: Path) -> Front:
    seen = stage.look(stage.front, depth=True)
    pose: Pose = seen.pose
    name = f"{seed}/front{number}.jpg"
    (folder / name).write_bytes(jpeg_bytes(seen.views[0].image))
    depth = seen.views[0].depth
    top = facade.facade_top_m(_front_view(depth), stand_off, pose.z, _FACADE) if depth is not None else None
    return Front(
        number=number,
        camera_m=pose.z,
        stand_off_m=stand_off,
        facade_top_m=top,
        picture=name,
        truth=stage.truth(stage.front)[0],
    )


def _front_view(depth: DepthMap) -> DepthView:
    return DepthView(pinhole(depth.width, depth.height, 90.0), decode_depth(depth))


def _stand_off(seen: Observation) -> float | None:
    depth = seen.views[0].depth
    return None if depth is None else facade.stand_off_m(_front_view(depth), _FACADE)
