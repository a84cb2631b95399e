"""What is left out of a view would not have shown."""

from dataclasses import replace
from math import cos, pi, sin

import numpy as np
import pytest

from contracts.geometry import Point2, Point3, Pose
from contracts.scene import Building, Scene, Start
from contracts.scene_layout import floor_outline
from services.sim.catalogue import build
from services.sim.geometry.mesh import concatenate
from services.sim.geometry.occluders import occluders
from services.sim.geometry.parts import Assembly
from services.sim.geometry.scene_mesh import SceneMesh, build_scene_mesh
from services.sim.geometry.solids import box
from services.sim.geometry.textures import base_textures
from services.sim.render.culling import Culler, hidden
from services.sim.render.gl import GlRenderer
from services.sim.render.views import RenderedViews, view_axes
from tests.cameras import square, squares

FRONT = square(size=200)
CAMERAS = squares((-90, -45, 0, 45, 90), 200)
L = ((-9.0, -8.0), (9.0, -8.0), (9.0, 2.0), (1.0, 2.0), (1.0, 9.0), (-9.0, 9.0))
FAR = ((-22.0, -6.0), (-14.0, -6.0), (-14.0, 8.0), (-22.0, 8.0))
NEAR = ((14.0, -6.0), (22.0, -6.0), (22.0, 8.0), (14.0, 8.0))


def street(setback_m: float = 0.0) -> Scene:
    # a house that sets back has no inner corners
    plans = {"target": NEAR if setback_m else L, "other": FAR if setback_m else NEAR}
    houses = tuple(
        Building(
            id=name,
            kind="low_rise",
            floors=4,
            setback_m=setback_m,
            footprint=tuple(Point2(x=x, y=y) for x, y in plan),
        )
        for name, plan in plans.items()
    )
    start = Start(position=Point3(x=0, y=-16, z=1.2), yaw=pi / 2)
    return Scene(name="test", seed=3, buildings=houses, target="target", start=start)


def boxes(rng: np.random.Generator, count: int) -> SceneMesh:
    assembly = Assembly()
    for k in range(count):
        assembly.draw(
            assembly.part("object", f"box-{k}"),
            [box(rng.uniform(0.5, 4, 3).tolist(), rng.uniform(-25, 25, 3).tolist()) for _ in range(9)],
        )
    owners = [np.full(m.vertex_count, o, np.uint16) for m, o in zip(assembly.meshes, assembly.owners, strict=True)]
    plain = build_scene_mesh(street(), build, base_textures())
    return replace(
        plain,
        mesh=concatenate(assembly.meshes),
        part_of=np.concatenate(owners),
        parts=tuple(assembly.parts),
        chunks=assembly.chunks(),
        occluders=np.zeros((0, 5)),
    )


def test_a_box_called_hidden_is_behind_the_wall_from_corner_to_corner() -> None:
    rng = np.random.default_rng(5)
    count = 0
    for _ in range(200):
        wall = np.array([[*rng.uniform(-12, 12, 4), rng.uniform(5, 25)]])
        eye = np.array([*rng.uniform(-20, 20, 2), rng.uniform(0.5, 20)])
        low = np.column_stack([rng.uniform(-30, 30, (40, 2)), rng.uniform(0, 12, 40)])
        high = low + rng.uniform(0.1, 3, (40, 3))
        for k in np.flatnonzero(hidden(low, high, eye, wall)):
            count += 1
            for corner in np.array(np.meshgrid(*zip(low[k], high[k], strict=True))).reshape(3, -1).T:
                # where the line of sight meets the wall's plane: within its ends, under its top, before the corner
                a, b = wall[0, 0:2], wall[0, 2:4]
                way, along = corner[:2] - eye[:2], b - a
                share, at = np.linalg.solve(np.column_stack([way, -along]), a - eye[:2])
                assert 0 < share <= 1
                assert 0 <= at <= 1
                assert eye[2] + share * (corner[2] - eye[2]) <= wall[0, 4]
    assert count > 50


def test_every_face_that_turns_to_the_eye_in_the_open_is_drawn_once_nearest_chunk_first() -> None:
    scene = boxes(np.random.default_rng(2), 20)
    eye = np.array([40.0, 0.0, 0.0])
    faces = Culler(scene).seen_from(eye).towards(view_axes(Pose(x=40, y=0, z=0, yaw=pi), FRONT), FRONT)
    drawn = {tuple(face) for face in faces.tolist()}
    assert len(drawn) == len(faces)
    corners = scene.mesh.positions[scene.mesh.faces].astype(np.float64)
    turned = np.einsum(
        "ij,ij->i", np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), eye - corners[:, 0]
    )
    ahead = (np.abs(corners[:, :, 1:]) < (40 - corners[:, :, 0])[:, :, None]).all(axis=(1, 2))
    assert {tuple(face) for face in scene.mesh.faces[(turned > 0.1) & ahead].tolist()} <= drawn
    assert not drawn & {tuple(face) for face in scene.mesh.faces[turned < -0.1].tolist()}
    part = scene.part_of[faces[:, 0]]
    order = list(dict.fromkeys(part.tolist()))
    gaps = [np.linalg.norm(np.maximum(np.maximum(c.low - eye, eye - c.high), 0)) for c in map(_arrays, scene.chunks)]
    assert [gaps[p - 1] for p in order] == sorted(gaps[p - 1] for p in order)
    assert len(part) == sum(len(list(group)) for group in np.split(part, np.flatnonzero(np.diff(part)) + 1))


@pytest.mark.parametrize("setback_m", [0.0, 0.6])
def test_occluders_stand_inside_every_floor(setback_m: float) -> None:
    scene = street(setback_m)
    walls = occluders(scene)
    assert len(walls) >= 8
    for building in scene.buildings:
        for floor in range(1, building.floors + 1):
            outline = np.array(floor_outline(building, floor))
            low, high = outline.min(axis=0), outline.max(axis=0)
            own = walls[(walls[:, 0] > 12) == (low[0] > 12)]
            for end in (own[:, 0:2], own[:, 2:4]):
                assert (end > low + 0.5).all()
                assert (end < high - 0.5).all()
    assert (walls[:, 4] <= 4 * scene.buildings[0].floor_height_m).all()


def test_pictures_are_the_same_with_and_without_walls_to_hide_behind() -> None:
    mesh = build_scene_mesh(street(), build, base_textures())
    assert len(mesh.occluders)
    renderer = GlRenderer()
    saved = 0

    def seen(scene: SceneMesh) -> list[RenderedViews]:
        uploaded = renderer.upload(scene)
        try:
            return [renderer.render(uploaded, pose, CAMERAS, labelled=True) for pose in poses]
        finally:
            uploaded.release()

    poses = [Pose(x=6 + 24 * cos(a), y=24 * sin(a), z=2 + a, yaw=a + pi) for a in np.linspace(0, 6, 7)]
    bare = replace(mesh, occluders=np.zeros((0, 5)))
    for pose, a, b in zip(poses, seen(mesh), seen(bare), strict=True):
        assert np.array_equal(a.rgb, b.rgb)
        assert np.array_equal(a.depth_units, b.depth_units)
        assert a.ids is not None
        assert b.ids is not None
        assert np.array_equal(a.ids, b.ids)
        eye, axes = np.array([pose.x, pose.y, pose.z]), view_axes(pose, FRONT)
        saved += len(Culler(bare).seen_from(eye).towards(axes, FRONT))
        saved -= len(Culler(mesh).seen_from(eye).towards(axes, FRONT))
    renderer.close()
    assert saved > 1000


class _Box:
    def __init__(self, low: tuple[float, ...], high: tuple[float, ...]) -> None:
        self.low, self.high = np.array(low), np.array(high)


def _arrays(chunk: object) -> _Box:
    return _Box(chunk.low, chunk.high)  # type: ignore[attr-defined]
