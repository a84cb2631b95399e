"""What every renderer must do alike: the camera, the depth, the ids. Run over OpenGL and over TinyRenderer."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import cos, pi, radians, sin

import numpy as np
import pytest
import shapely

from contracts.cameras import Camera, MountingOffset, pinhole_camera
from contracts.geometry import Point2, Pose
from contracts.scene import Light
from contracts.scene_traffic import Person
from services.sim.geometry.courses import Course
from services.sim.geometry.mesh import Mesh, concatenate
from services.sim.geometry.parts import Assembly, Part
from services.sim.geometry.scene_mesh import SceneMesh
from services.sim.geometry.solids import box, ellipsoid, quad
from services.sim.geometry.textures import base_textures
from services.sim.geometry.traffic import MovingPart
from services.sim.render.gl import GlRenderer
from services.sim.render.tiny import TinyRenderer
from services.sim.render.views import RenderedViews, Renderer, eye_of, project, view_axes
from tests.cameras import square, squares

HEADINGS = (-90, -45, 0, 45, 90)
SIZE = 160
FRONT = square(size=SIZE)
FIVE = squares(HEADINGS, SIZE)
UNIT_M = 0.002


@pytest.fixture(scope="module", params=[GlRenderer, TinyRenderer])
def renderer(request: pytest.FixtureRequest) -> Iterator[Renderer]:
    made: Renderer = request.param()
    yield made
    made.close()


def scene_of(*meshes: Mesh) -> SceneMesh:
    assembly = Assembly()
    for i, mesh in enumerate(meshes):
        assembly.draw(assembly.part("object", f"thing-{i + 1}"), mesh)
    owners = [np.full(m.vertex_count, o, np.uint16) for m, o in zip(assembly.meshes, assembly.owners, strict=True)]
    return SceneMesh(
        concatenate(assembly.meshes),
        np.concatenate(owners),
        tuple(assembly.parts),
        assembly.chunks(),
        (),
        base_textures(),
        Light(),
        (0.0, 0.0, 0.0),
    )


def seen(renderer: Renderer, scene: SceneMesh, pose: Pose, cameras: Sequence[Camera] = (FRONT,)) -> RenderedViews:
    uploaded = renderer.upload(scene)
    try:
        return renderer.render(uploaded, pose, cameras)
    finally:
        uploaded.release()


def ids(renderer: Renderer, scene: SceneMesh, pose: Pose, cameras: Sequence[Camera] = (FRONT,)) -> np.ndarray:
    uploaded = renderer.upload(scene)
    try:
        return np.stack(renderer.render_ids(uploaded, pose, cameras))
    finally:
        uploaded.release()


def wall_ahead(pose: Pose, distance_m: float, turned: float = 0.0) -> Mesh:
    """A large wall whose middle is straight ahead, facing back, turned about the upright axis."""
    a = pose.yaw + turned
    out, side = np.array([-cos(a), -sin(a)]), np.array([sin(a), -cos(a)])
    middle = np.array([pose.x + distance_m * cos(pose.yaw), pose.y + distance_m * sin(pose.yaw)])
    left, right = middle - 60 * side, middle + 60 * side
    wall = quad([(*left, -60), (*right, -60), (*right, 60), (*left, 60)])
    assert wall.normals[0, :2] @ out > 0.99
    return wall


def test_a_wall_straight_ahead_has_the_same_planar_depth_everywhere(renderer: Renderer) -> None:
    pose = Pose(x=3, y=-2, z=5, yaw=0.7)
    depth = seen(renderer, scene_of(wall_ahead(pose, 7.5)), pose).depth_m()[0]
    assert np.abs(depth - 7.5).max() <= UNIT_M


def test_a_slanting_wall_has_the_depth_of_the_pixel_centres_rays(renderer: Renderer) -> None:
    pose = Pose(x=0, y=0, z=5, yaw=-0.4)
    depth = seen(renderer, scene_of(wall_ahead(pose, 8.0, turned=0.5)), pose).depth_m()[0]
    # the wall's plane: forward * cos(t) - right * sin(t) = 8 cos(t), with right = slope * forward on a pixel's ray
    slope = (np.arange(SIZE) + 0.5 - SIZE / 2) / (SIZE / 2)
    expected = 8.0 * cos(0.5) / (cos(0.5) - slope * sin(0.5))
    assert np.abs(depth - expected[None, :]).max() <= 2 * UNIT_M


@pytest.mark.parametrize("heading", HEADINGS)
def test_a_point_appears_where_the_pinhole_puts_it(renderer: Renderer, heading: float) -> None:
    pose = Pose(x=1, y=2, z=6, yaw=2.1)
    a = pose.yaw - radians(heading) - 0.2
    place = np.array([pose.x + 9 * cos(a), pose.y + 9 * sin(a), 8.0])
    view = ids(renderer, scene_of(box((0.5, 0.5, 0.5), place.tolist())), pose, [square(heading, SIZE)])[0]
    rows, columns = np.nonzero(view)
    x, y, _ = project(pose, square(heading, SIZE), place[None])[0]
    assert abs(columns.mean() + 0.5 - x) < 0.7
    assert abs(rows.mean() + 0.5 - y) < 0.7
    assert x > SIZE / 2  # clockwise from the axis is right
    assert y < SIZE / 2


ODD = Camera(
    name="odd",
    width=200,
    height=120,
    fx_px=70.0,
    fy_px=90.0,
    cx_px=80.0,
    cy_px=75.0,
    heading_deg=-30.0,
    pitch_deg=25.0,
    offset=MountingOffset(forward_m=0.3, right_m=-0.2, up_m=0.15),
)


@pytest.mark.parametrize(("x_px", "y_px"), [(20.0, 20.0), (170.0, 40.0), (60.0, 100.0)])
def test_any_pinhole_anywhere_on_the_drone_shows_a_point_where_its_numbers_say(
    renderer: Renderer, x_px: float, y_px: float
) -> None:
    pose = Pose(x=1, y=2, z=6, yaw=2.1)
    right, up, forward = view_axes(pose, ODD)
    ray = forward + (x_px - ODD.cx_px) / ODD.fx_px * right - (y_px - ODD.cy_px) / ODD.fy_px * up
    place = eye_of(pose, ODD) + 9.0 * ray
    pictures = seen(renderer, scene_of(ellipsoid(0.25, place.tolist(), 24, 16)), pose, [ODD, FRONT])
    assert [picture.shape for picture in pictures.rgb] == [(120, 200, 3), (SIZE, SIZE, 3)]
    rows, columns = np.nonzero(np.isfinite(pictures.depth_m()[0]))
    assert columns.mean() + 0.5 == pytest.approx(x_px, abs=1.0)
    assert rows.mean() + 0.5 == pytest.approx(y_px, abs=1.0)
    assert pictures.depth_m()[0][rows, columns].min() == pytest.approx(9.0, abs=0.3)
    assert project(pose, ODD, place[None])[0] == pytest.approx([x_px, y_px, 9.0])


def test_a_camera_that_looks_up_sees_what_hangs_there_and_the_sky_round_it(renderer: Renderer) -> None:
    up = square(size=SIZE).model_copy(update={"pitch_deg": 90.0})
    pose = Pose(x=0, y=0, z=3, yaw=0.3)
    view = seen(renderer, scene_of(box((2, 2, 1), (0, 0, 8.5))), pose, [up])
    depth = view.depth_m()[0]
    assert depth[SIZE // 2, SIZE // 2] == pytest.approx(5.0, abs=2 * UNIT_M)
    assert np.isinf(depth[0]).all()
    assert view.rgb[0][0].min() > 60  # daylight
    # the picture's upper edge is behind the drone's head: what stands there is seen at the top
    behind = seen(renderer, scene_of(box((1, 1, 1), (-4 * cos(0.3), -4 * sin(0.3), 9.5))), pose, [up])
    rows, _ = np.nonzero(np.isfinite(behind.depth_m()[0]))
    assert rows.mean() < SIZE / 2


def test_the_sky_is_the_same_in_a_view_that_sees_higher() -> None:
    gl = GlRenderer()
    usual = square(size=SIZE)
    taller = usual.model_copy(update={"height": 2 * SIZE, "cy_px": usual.cy_px + SIZE})
    uploaded = gl.upload(scene_of(box((1, 1, 1), (6, 0, -2))))
    low, high = gl.render(uploaded, Pose(x=0, y=0, z=2, yaw=0.4), [usual, taller]).rgb
    difference = np.abs(high[SIZE : SIZE + SIZE // 2].astype(int) - low[: SIZE // 2].astype(int))
    assert difference.mean() < 1.0
    gl.close()


def test_positive_headings_look_to_the_right(renderer: Renderer) -> None:
    north = Pose(x=0, y=0, z=2, yaw=pi / 2)
    scene = scene_of(box((1, 1, 1), (6, 0, 2)), box((1, 1, 1), (-6, 0, 2)))
    view = ids(renderer, scene, north, squares((90, -90), SIZE))
    assert set(np.unique(view[0])) == {0, 1}  # east
    assert set(np.unique(view[1])) == {0, 2}  # west


def test_where_nothing_stands_the_depth_is_infinite_and_the_id_0(renderer: Renderer) -> None:
    pose = Pose(x=0, y=0, z=2, yaw=0.0)
    scene = scene_of(box((1, 1, 1), (6, 0, 2)))
    view, part = seen(renderer, scene, pose), ids(renderer, scene, pose)
    assert (np.isinf(view.depth_m()[0]) == (part[0] == 0)).all()
    assert (part == 1).any()


def test_faces_are_only_seen_from_outside(renderer: Renderer) -> None:
    scene = scene_of(box((4, 4, 4), (0, 0, 2)))
    inside = ids(renderer, scene, Pose(x=0, y=0, z=2, yaw=0.3))
    outside = ids(renderer, scene, Pose(x=-9, y=0, z=2, yaw=0.0))
    assert (outside == 1).any()
    if renderer.name == "moderngl":
        assert not inside.any()


def test_the_same_scene_and_pose_give_the_same_bytes_again_and_after_another_upload(renderer: Renderer) -> None:
    pose = Pose(x=-8, y=0.5, z=3, yaw=0.1)
    scene = scene_of(box((3, 5, 4), (0, 0, 2), "#a05030", base_textures().layer("brick")), ellipsoid(1.2, (-2, 3, 3)))
    other = scene_of(box((9, 9, 9), (0, 0, 0), "#1020f0"))
    first = seen(renderer, scene, pose, FIVE)
    seen(renderer, other, pose, FIVE)
    again = seen(renderer, scene, pose, FIVE)
    assert np.array_equal(first.rgb, again.rgb)
    assert np.array_equal(first.depth_units, again.depth_units)


def test_ids_beside_the_pictures_are_the_ids_alone_and_change_no_picture(renderer: Renderer) -> None:
    pose = Pose(x=-8, y=0.5, z=3, yaw=0.1)
    scene = scene_of(box((30, 30, 1), (0, 0, -0.5)), box((3, 5, 4), (0, 0, 2)), ellipsoid(1.2, (-2, 3, 3)))
    uploaded = renderer.upload(scene)
    plain = renderer.render(uploaded, pose, FIVE)
    labelled = renderer.render(uploaded, pose, FIVE, labelled=True)
    assert plain.ids is None
    assert labelled.ids is not None
    assert set(np.unique(labelled.ids)) == {0, 1, 2, 3}
    assert np.array_equal(labelled.ids, renderer.render_ids(uploaded, pose, FIVE))
    assert np.array_equal(labelled.rgb, plain.rgb)
    assert np.array_equal(labelled.depth_units, plain.depth_units)
    uploaded.release()


def test_sizes_and_counts_beyond_the_limits_are_refused(renderer: Renderer) -> None:
    uploaded = renderer.upload(scene_of(box((1, 1, 1))))
    pose = Pose(x=-5, y=0, z=0, yaw=0)
    wide = pinhole_camera("wide", 4096, 1024, horizontal_fov_deg=120.0)
    for cameras in ([square(size=2000)], [wide], [], squares([0.0] * 17, 100)):
        with pytest.raises(ValueError, match="can be drawn"):
            renderer.render(uploaded, pose, cameras)
    uploaded.release()


def test_both_renderers_see_the_same_silhouettes_and_depths() -> None:
    scene = scene_of(
        box((240, 240, 1), (0, 0, -0.5)), box((4, 4, 8), (10, 3, 4)), ellipsoid((2, 2, 2), (12, -6, 3), 24, 16)
    )
    pose = Pose(x=0, y=0, z=3, yaw=0.1)
    gl, tiny = GlRenderer(), TinyRenderer()
    a, b = ids(gl, scene, pose, FIVE), ids(tiny, scene, pose, FIVE)
    assert (a != b).mean() < 0.001
    da, db = (np.stack(seen(r, scene, pose, FIVE).depth_m()) for r in (gl, tiny))
    near = (a == b) & (da < 60)
    # the software renderer's depth buffer loses digits with the distance
    assert (np.abs(da[near] - db[near]) <= 0.004 + 0.0005 * da[near]).mean() > 0.999
    gl.close()


def test_what_moves_is_drawn_and_labelled_where_it_is_at_the_moment_of_the_look(renderer: Renderer) -> None:
    way = (Point2(x=0.0, y=-20.0), Point2(x=0.0, y=20.0))
    person = Person(id="anna", way=way, phase=0.25, speed_m_s=1.0)
    still = scene_of(box((60, 60, 1), (0, 0, -0.5)))
    walking = MovingPart(2, Course(person, shapely.Polygon()), (box((0.5, 0.5, 1.75), (0, 0, 0.875), "#c02020"),))
    scene = replace(still, parts=(*still.parts, Part(2, "traffic", "anna")), moving=(walking,))
    pose = Pose(x=-8.0, y=0.0, z=1.0, yaw=0.0)
    uploaded = renderer.upload(scene)
    for time_s in (0.0, 2.0, 0.0):
        views = renderer.render(uploaded, pose, (FRONT,), time_s, labelled=True)
        assert views.ids is not None
        hers = views.ids[0] == 2
        column = FRONT.cx_px - FRONT.fx_px * time_s / 8.0
        assert np.nonzero(hers)[1].mean() == pytest.approx(column, abs=3.0)
        assert np.median(views.depth_m()[0][hers]) == pytest.approx(7.75, abs=0.02)
        red, _, blue = views.rgb[0][hers].mean(axis=0)
        assert red > 2.0 * blue
    uploaded.release()
