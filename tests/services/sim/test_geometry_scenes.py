"""Built scenes: windows where the layout's law puts them, objects where they belong, the same bytes every time."""

import json
from functools import cache
from math import atan2, cos, pi, sin
from pathlib import Path

import numpy as np
import pytest

from contracts.geometry import Point2, Point3, Pose
from contracts.scene import (
    BalconyPlan,
    Building,
    BuildingKind,
    FreePlace,
    Ground,
    Road,
    Scene,
    SceneObject,
    Start,
    Tree,
    WindowGrid,
    WindowPlace,
)
from contracts.scene_layout import columns_of, facades, window_slot
from services.sim.geometry.entrances import door_spot, toward_start
from services.sim.geometry.mesh import Mesh
from services.sim.geometry.scene_mesh import SceneMesh, UnknownObject, build_scene_mesh
from services.sim.geometry.solids import standing_box
from services.sim.geometry.textures import TextureSet, base_textures
from services.sim.render.gl import GlRenderer
from services.sim.render.views import project
from services.sim.world import Blueprint, World
from tests.cameras import square

_BLOCK = ((-8.0, -6.0), (8.0, -6.0), (8.0, 6.0), (-8.0, 6.0))
_L = ((-9.0, -8.0), (9.0, -8.0), (9.0, 2.0), (1.0, 2.0), (1.0, 9.0), (-9.0, 9.0))
_PLUS = (
    (-4, -10), (4, -10), (4, -4), (10, -4), (10, 4), (4, 4), (4, 10), (-4, 10), (-4, 4), (-10, 4), (-10, -4), (-4, -4),
)  # fmt: skip
_OCTAGON = tuple((9 * cos(pi / 8 + k * pi / 4), 9 * sin(pi / 8 + k * pi / 4)) for k in range(8))


def cube(kind: str, colour: str, textures: TextureSet) -> Mesh:
    """A catalogue of one thing."""
    if kind != "cube":
        raise UnknownObject(f"there is no {kind}; there is cube")
    return standing_box((0.4, 0.5, 0.6), colour="#20a030")


def building(plan: tuple[tuple[float, float], ...] = _BLOCK, **changes: object) -> Building:
    fields: dict[str, object] = {"id": "target", "kind": "low_rise", "floors": 4}
    return Building.model_validate(fields | {"footprint": tuple(Point2(x=x, y=y) for x, y in plan)} | changes)


def scene(house: Building, *objects: SceneObject) -> Scene:
    return Scene(
        name="test",
        seed=7,
        buildings=(house,),
        target=house.id,
        objects=objects,
        ground=Ground(
            half_size_m=40,
            roads=(Road(start=Point2(x=-60, y=-25), end=Point2(x=60, y=-25)),),
            trees=(Tree(position=Point2(x=30, y=0)),),
        ),
        start=Start(position=Point3(x=0, y=-18, z=1.2), yaw=pi / 2),
    )


def at_window(on: str, floor: int = 2, column: int = 1, facade: int = 0) -> SceneObject:
    place = WindowPlace.model_validate(
        {"building": "target", "facade": facade, "floor": floor, "column": column, "on": on}
    )
    return SceneObject(id=f"thing-{on}", kind="cube", colour="green", place=place)


@cache
def plain() -> SceneMesh:
    return build_scene_mesh(scene(building()), cube, base_textures())


def test_the_panes_lie_in_reveals_where_the_layout_puts_the_windows() -> None:
    house = building()
    gl, camera = GlRenderer(), square(size=600)
    uploaded = gl.upload(plain())
    for facade in range(4):
        for floor in (1, 3):
            slot = window_slot(house, facade, floor, 1)
            x, y, z = slot.centre
            pose = Pose(
                x=x + 6 * slot.normal[0], y=y + 6 * slot.normal[1], z=z, yaw=atan2(-slot.normal[1], -slot.normal[0])
            )
            depth = gl.render(uploaded, pose, [camera]).depth_m()[0]
            quarter = np.array([x, y, z]) + 0.25 * slot.width_m * np.array([*slot.along, 0.0])
            for point, deep in (
                (quarter, house.windows.reveal_m),
                (quarter + np.array([0, 0, 0.4]), house.windows.reveal_m),
            ):
                u, v, _ = project(pose, camera, point[None])[0]
                assert depth[int(v), int(u)] == pytest.approx(6.0 + deep, abs=0.07)
            pier = np.array([x, y, z]) + house.windows.pitch_m / 2 * np.array([*slot.along, 0.0])
            u, v, _ = project(pose, camera, pier[None])[0]
            assert depth[int(v), int(u)] == pytest.approx(6.0, abs=0.12)
    gl.close()


def test_a_window_with_a_balcony_is_a_door_and_others_keep_their_ledge() -> None:
    plan = BalconyPlan(facades=(0,), columns=(1,), depth_m=1.3)
    built = build_scene_mesh(scene(building(balconies=(plan,))), cube, base_textures())
    positions = built.mesh.positions[built.part_of == built.part("building", "target").id]
    slot = window_slot(building(), 0, 3, 1)
    near = np.abs(positions[:, 0] - slot.centre[0]) < 1.4
    reach = -6.0 - positions[near & (np.abs(positions[:, 2] - 6.0) < 0.3)][:, 1]
    assert reach.max() == pytest.approx(1.3, abs=0.1)


@pytest.mark.parametrize("on", ["sill", "balcony", "wall", "pane", "hang"])
def test_an_object_stands_near_its_own_window_in_front_of_the_pane(on: str) -> None:
    house = building(balconies=(BalconyPlan(facades=(0,), columns=(1,)),) if on == "balcony" else ())
    built = build_scene_mesh(scene(house, at_window(on)), cube, base_textures())
    own = built.mesh.positions[built.part_of == built.part("object", f"thing-{on}").id]
    slot = window_slot(house, 0, 2, 1)
    out = -(own[:, 1] - slot.centre[1])
    assert out.min() >= -house.windows.reveal_m
    assert out.max() <= 1.5
    assert np.linalg.norm(own.mean(axis=0) - slot.centre) < 1.9
    if on == "sill":
        assert own[:, 2].min() == pytest.approx(slot.sill_z, abs=0.02)
    if on == "balcony":
        assert own[:, 2].min() == pytest.approx(house.floor_height_m, abs=0.02)


def test_an_object_that_faces_out_of_the_facade_has_its_front_outside() -> None:
    def arrow(kind: str, colour: str, textures: TextureSet) -> Mesh:
        return standing_box((0.4, 0.1, 0.1), (0.2, 0.0, 0.0))

    house = building()
    for facade in range(4):
        slot = window_slot(house, facade, 2, 0)
        thing = at_window("wall", column=0, facade=facade)
        built = build_scene_mesh(scene(house, thing), arrow, base_textures())
        own = built.mesh.positions[built.part_of == built.part("object", thing.id).id]
        out = (own[:, :2] - np.array(slot.centre[:2])) @ np.array(slot.normal)
        assert out.max() - out.min() == pytest.approx(0.4, abs=1e-3)
        assert out.min() >= 0.0


def test_a_free_object_stands_where_it_is_put() -> None:
    thing = SceneObject(
        id="x", kind="cube", colour="green", place=FreePlace(position=Point3(x=3, y=-15, z=0.0)), scale=2
    )
    built = build_scene_mesh(scene(building(), thing), cube, base_textures())
    own = built.mesh.positions[built.part_of == built.part("object", "x").id]
    assert own.min(axis=0) == pytest.approx([2.6, -15.5, 0.0], abs=1e-4)
    assert own.max(axis=0) == pytest.approx([3.4, -14.5, 1.2], abs=1e-4)


def test_an_unknown_object_says_what_there_is() -> None:
    thing = SceneObject(id="x", kind="dragon", colour="green", place=FreePlace(position=Point3(x=0, y=-15, z=0)))
    with pytest.raises(UnknownObject, match="cube"):
        build_scene_mesh(scene(building(), thing), cube, base_textures())


def test_the_same_document_gives_the_same_bytes() -> None:
    again = build_scene_mesh(scene(building()), cube, base_textures())
    for name in ("positions", "normals", "uv", "colours", "layer", "faces"):
        assert getattr(plain().mesh, name).tobytes() == getattr(again.mesh, name).tobytes()
    assert [s.positions.tobytes() for s in plain().solids] == [s.positions.tobytes() for s in again.solids]


def test_chunks_cover_every_face_once_and_bound_their_vertices() -> None:
    built = plain()
    assert sum(c.face_count for c in built.chunks) == built.mesh.triangle_count
    first = 0
    for chunk in built.chunks:
        assert chunk.first_face == first
        first += chunk.face_count
        own = built.mesh.positions[built.mesh.faces[chunk.first_face : first].ravel()]
        assert (own >= np.array(chunk.low) - 1e-4).all()
        assert (own <= np.array(chunk.high) + 1e-4).all()


@pytest.mark.parametrize(
    ("kind", "roof"),
    [
        ("low_rise", "flat"),
        ("low_rise", "hip"),
        ("high_rise", "flat"),
        ("villa", "gable"),
        ("cultural", "pagoda"),
        ("cultural", "hall"),
    ],
)
@pytest.mark.parametrize("plan", [_L, _PLUS, _OCTAGON], ids=["L", "plus", "octagon"])
def test_every_kind_stands_on_every_plan(kind: BuildingKind, roof: str, plan: tuple[tuple[float, float], ...]) -> None:
    house = building(plan, kind=kind, roof=roof, floors=3, floor_height_m=3.6)
    built = build_scene_mesh(scene(house), cube, base_textures())
    own = built.mesh.positions[built.part_of == built.part("building", "target").id]
    assert np.isfinite(built.mesh.positions).all()
    assert np.isfinite(built.mesh.uv).all()
    assert np.linalg.norm(built.mesh.normals, axis=1).min() > 0.99
    assert own[:, 2].max() >= 3 * 3.6
    solid = next(s for s in built.solids if s.name == "target")
    # walls are solid from the ground to the roof
    assert solid.positions[:, 2].min() <= 0.0
    assert solid.positions[:, 2].max() >= 3 * 3.6 - 1e-3


def test_a_pagoda_sets_back_floor_by_floor() -> None:
    house = building(_OCTAGON, kind="cultural", roof="pagoda", floors=5, floor_height_m=3.6, setback_m=0.7)
    built = build_scene_mesh(scene(house), cube, base_textures())
    lengths = [facades(house, k)[0].length_m for k in range(1, 6)]
    assert lengths == sorted(lengths, reverse=True)
    own = next(s for s in built.solids if s.name == "target").positions
    # under the eaves of each tier stands a narrower wall
    widths = []
    for k in range(5):
        storey = own[np.abs(own[:, 2] - (k * 3.6 if k else -0.2)) < 1e-3]
        widths.append(float(np.abs(storey[:, 0]).max()))
    assert widths == sorted(widths, reverse=True)
    assert widths[0] > widths[-1] + 2.0


@pytest.mark.parametrize("kind", ["villa", "low_rise", "high_rise"])
@pytest.mark.parametrize(("up_m", "out_m"), [(1.2, 0.03), (2.25, 0.12)])
def test_a_drone_comes_as_near_to_a_door_as_it_is_drawn(kind: BuildingKind, up_m: float, out_m: float) -> None:
    house = building(kind=kind, floors=2)
    document = scene(house)
    spot = door_spot(house, toward_start(house, document.start.position.x, document.start.position.y))
    assert spot is not None
    world = World(Blueprint(build_scene_mesh(document, cube, base_textures()).solids, 60.0, 10.0), radius_m=0.02)
    before, at = (tuple((spot.frame @ (x, 0.0, up_m, 1.0))[:3].tolist()) for x in (1.0, -0.5))
    free_m = world.sweep(before, at).free_m
    world.close()
    assert free_m == pytest.approx(1.0 - out_m - 0.02, abs=0.005)


def test_twenty_storeys_stay_light() -> None:
    house = building(
        kind="high_rise",
        floors=20,
        balconies=(BalconyPlan(facades=(0, 1, 2, 3), columns=(0, 2)),),
        windows=WindowGrid(width_m=1.5, pitch_m=3.2),
    )
    built = build_scene_mesh(scene(house), cube, base_textures())
    assert columns_of(house, 0) >= 4
    assert built.mesh.triangle_count < 300_000
    assert sum(len(s.faces) for s in built.solids) < 40_000


def test_the_shipped_samples_parse_and_build() -> None:
    folder = Path(__file__).resolve().parents[3] / "orchestrator" / "samples"
    paths = sorted(folder.glob("*.json"))
    assert paths
    for path in paths[:2]:
        document = Scene.model_validate(json.loads(path.read_text(encoding="utf-8"))["scene"])
        built = build_scene_mesh(
            document, lambda kind, colour, textures: cube("cube", colour, textures), base_textures()
        )
        assert {p.name for p in built.parts if p.kind == "object"} == {o.id for o in document.objects}
