"""Labels against a scene whose answers are known by hand."""

import math
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
import pytest

from contracts.geometry import Point2, Point3, Pose
from contracts.scene import Building, Ground, Scene, SceneObject, Start, WindowPlace
from contracts.scene_layout import window_slots
from contracts.sim import TruthView
from services.sim.bootstrap import build_scene
from services.sim.render.gl import GlRenderer
from services.sim.render.views import project
from services.sim.scenes import make_ready
from services.sim.truth import truth_view
from training.labels import STRIDE, Labeller, Labels
from training.render import SIZE_PX, colour_numbers, kind_numbers, view_camera
from training.shards import read, write

OFF_M, HEIGHT_M = 8.0, 4.6
FRONT = view_camera(0.0)
POSE = Pose(x=0.0, y=-6.0 - OFF_M, z=HEIGHT_M, yaw=math.pi / 2)


class Labelled(NamedTuple):
    scene: Scene
    labels: Labels
    truth: TruthView


def small_scene() -> Scene:
    """Four storeys of 3 m; a red teapot on one sill of the second floor, 8 m before the camera."""
    house = Building(
        id="target",
        kind="low_rise",
        floors=4,
        footprint=tuple(Point2(x=x, y=y) for x, y in ((-8.0, -6.0), (8.0, -6.0), (8.0, 6.0), (-8.0, 6.0))),
    )
    place = WindowPlace(building="target", facade=0, floor=2, column=2)
    return Scene(
        name="small",
        seed=3,
        buildings=(house,),
        target="target",
        objects=(SceneObject(id="pot", kind="teapot", colour="red", place=place),),
        goal="pot",
        ground=Ground(half_size_m=40),
        start=Start(position=Point3(x=0, y=-16, z=1.2), yaw=math.pi / 2),
    )


@pytest.fixture(scope="module")
def labelled() -> Labelled:
    ready = make_ready(small_scene(), build_scene)
    renderer = GlRenderer()
    try:
        ids = renderer.render_ids(renderer.upload(ready.mesh), POSE, [FRONT])[0]
    finally:
        renderer.close()
    labels = Labeller(ready.scene, ready.mesh, kind_numbers(), colour_numbers()).of(POSE, FRONT, ids)
    return Labelled(ready.scene, labels, truth_view(ready.scene, ready.mesh, ready.things, POSE, FRONT, ids))


def test_the_thing_is_what_the_simulator_says_it_is(labelled: Labelled) -> None:
    (thing,), (known,) = labelled.labels.things, labelled.truth.objects
    assert thing.kind == kind_numbers()["teapot"]
    assert thing.colour == colour_numbers()["red"]
    assert thing.goal
    assert thing.pixels == known.pixels
    assert thing.share == pytest.approx(known.share)
    assert thing.distance_m == pytest.approx(known.distance_m, abs=0.3)
    box = known.box
    expected = [side * SIZE_PX for side in (box.x_min, box.y_min, box.x_max, box.y_max)]
    assert list(thing.box) == pytest.approx(expected)


def test_windows_lie_where_the_layout_puts_them_and_piers_are_wall(labelled: Labelled) -> None:
    house = labelled.scene.buildings[0]
    slots = [s for s in window_slots(house) if s.facade == 0]
    pixels = project(POSE, FRONT, np.array([s.centre for s in slots]))
    pier_px = round(house.windows.pitch_m / 2 / OFF_M * SIZE_PX / 2)
    seen = 0
    for slot, (x, y, _) in zip(slots, pixels, strict=True):
        inside = 40 <= x < SIZE_PX - 40 - pier_px and 40 <= y < SIZE_PX - 40
        if not inside or (slot.floor, slot.column) == (2, 2):
            continue
        seen += 1
        assert labelled.labels.window[int(y) // STRIDE, int(x) // STRIDE] == 255
        assert labelled.labels.window[int(y) // STRIDE, int(x + pier_px) // STRIDE] == 0
    assert seen >= 8


def test_the_floors_are_ridges_at_the_heights_of_their_windows(labelled: Labelled) -> None:
    grid = labelled.scene.buildings[0].windows
    heights = [3.0 * k + grid.sill_m + grid.height_m / 2 for k in range(4)]
    rows = [SIZE_PX / 2 - SIZE_PX / 2 * (z - HEIGHT_M) / OFF_M for z in heights]
    assert [r / SIZE_PX for r in rows] == pytest.approx(labelled.truth.floor_rows)
    profile = labelled.labels.row[:, SIZE_PX // 2 // STRIDE].astype(float)
    found = [
        i for i in range(1, len(profile) - 1) if profile[i] > 150 and profile[i - 1] <= profile[i] > profile[i + 1]
    ]
    assert [(i + 0.5) * STRIDE for i in found] == pytest.approx(sorted(rows), abs=STRIDE)


def test_the_building_is_what_stands_before_the_sky_and_not_the_ground(labelled: Labelled) -> None:
    building = labelled.labels.building
    middle = SIZE_PX // 2 // STRIDE
    foot = SIZE_PX / 2 + SIZE_PX / 2 * HEIGHT_M / OFF_M
    assert building[middle, middle] == 255
    assert building[0, 0] == 0 or labelled.truth.building_box is not None
    assert building[int(foot) // STRIDE + 2, middle] == 0


def test_a_shard_comes_back_as_it_was_written(labelled: Labelled, tmp_path: Path) -> None:
    picture = np.full((SIZE_PX, SIZE_PX, 3), (200, 120, 40), np.uint8)
    jpeg = cv2.imencode(".jpg", picture[:, :, ::-1])[1].tobytes()
    write(tmp_path / "street-0000003.npz", 3, [jpeg, jpeg], [labelled.labels] * 2, [False, True], crowded=True)
    shard = read(tmp_path / "street-0000003.npz")
    assert shard.seed == 3
    assert shard.jpegs == (jpeg, jpeg)
    assert list(shard.things["view"]) == [0, 1]
    assert tuple(shard.things["box"][0]) == labelled.labels.things[0].box
    assert (shard.row[1] == labelled.labels.row).all()
    assert list(shard.frontal) == [False, True]
    assert np.abs(shard.picture(0).astype(int) - picture).max() <= 4
    assert not list(tmp_path.glob("*.part"))
