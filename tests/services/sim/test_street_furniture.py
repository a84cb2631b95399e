"""Hedges, fences, poles, wires, awnings and signs: seen in pictures, depth and ids, solid, and nothing else changes."""

from collections.abc import Iterator, Sequence
from math import pi
from typing import Any

import numpy as np
import pytest

from contracts.geometry import Pose
from contracts.scene import Ground, Scene
from contracts.sensor_profiles import StereoDepth, TimeOfFlightDepth, shipped_sensors
from service_kit.errors import BadQuestion
from services.sim.bootstrap import build_scene
from services.sim.geometry.letters import letters
from services.sim.geometry.scene_mesh import SceneMesh
from services.sim.render.gl import GlRenderer
from services.sim.render.views import RenderedViews
from services.sim.scenes import check
from services.sim.sensors.chance import generator
from services.sim.sensors.depth import sensed_depth
from services.sim.sensors.suite import frames_of
from services.sim.world import Blueprint, World
from tests.cameras import square
from tests.services.sim.conftest import make_yard

GROUND: dict[str, Any] = {
    "half_size_m": 60.0,
    "hedges": [{"start": {"x": -9, "y": -9}, "end": {"x": -6, "y": -9}}],
    "fences": [
        {"start": {"x": 3 * k, "y": -9}, "end": {"x": 3 * k + 2.5, "y": -9}, "kind": kind}
        for k, kind in enumerate(("wall", "pickets", "bars"), start=1)
    ],
    "poles": [{"position": {"x": 0, "y": -9}}, {"position": {"x": -12, "y": -9}, "kind": "steel"}],
    "wires": [{"start": {"x": -12, "y": -9, "z": 6.5}, "end": {"x": 0, "y": -9, "z": 6.5}, "diameter_m": 0.02}],
}
SHOP: dict[str, Any] = {
    "awnings": [{"facade": 0, "column": 0, "stripes": "#ffffff"}, {"facade": 0, "column": 2, "drop_m": 0.0}],
    "signs": [
        {"facade": 0, "column": 0, "columns": 2, "text": "Bäckerei"},
        {"facade": 0, "column": 1, "text": "Café", "kind": "projecting"},
    ],
}
WALKER = {"kind": "person", "id": "anna", "way": [{"x": -9, "y": -11}, {"x": 9, "y": -11}], "phase": 0.2}
LOOK = Pose(x=-2.0, y=-15.0, z=3.2, yaw=pi / 2)


def bare() -> Scene:
    return make_yard(objects=(), goal=None)


def furnished(ground: dict[str, Any] = GROUND, shop: dict[str, Any] = SHOP) -> Scene:
    yard = bare().model_dump(mode="json")
    yard["ground"] |= ground
    yard["buildings"][0] |= shop
    return Scene.model_validate(yard)


@pytest.fixture(scope="module")
def gl() -> Iterator[GlRenderer]:
    renderer = GlRenderer()
    yield renderer
    renderer.close()


@pytest.fixture(scope="module")
def built() -> SceneMesh:
    return build_scene(furnished())


def drawn(gl: GlRenderer, mesh: SceneMesh, pose: Pose = LOOK) -> RenderedViews:
    uploaded = gl.upload(mesh)
    try:
        return gl.render(uploaded, pose, [square(size=400)], labelled=True, panes=True)
    finally:
        uploaded.release()


def test_nothing_that_was_there_before_is_moved_or_coloured_anew(built: SceneMesh) -> None:
    plain = build_scene(bare())

    def corners(mesh: SceneMesh) -> set[tuple[float, ...]]:
        rows = np.column_stack([mesh.mesh.positions, mesh.mesh.colours, mesh.mesh.uv, mesh.part_of])
        return set(map(tuple, rows.tolist()))

    assert corners(plain) < corners(built)
    assert [part.name for part in plain.parts] == [part.name for part in built.parts]


def test_it_is_in_the_picture_nearer_in_depth_and_its_owners_in_the_ids(gl: GlRenderer, built: SceneMesh) -> None:
    before, after = drawn(gl, build_scene(bare())), drawn(gl, built)
    assert before.ids is not None
    assert after.ids is not None
    nearer = after.depth_units[0] < before.depth_units[0]
    assert nearer.mean() > 0.05
    assert (after.depth_units[0] <= before.depth_units[0]).all()
    assert (before.rgb[0][nearer] != after.rgb[0][nearer]).any(axis=1).mean() > 0.9
    names = {built.parts[number - 1].name for number in np.unique(after.ids[0][nearer])}
    assert names == {"house", "surroundings"}


@pytest.mark.parametrize(
    ("what", "start", "end"),
    [
        ("surroundings", (-7.5, -12.0, 0.8), (-7.5, -7.0, 0.8)),  # the hedge
        ("surroundings", (4.0, -12.0, 0.6), (4.0, -7.0, 0.6)),  # the garden wall
        ("surroundings", (7.0, -12.0, 0.6), (7.0, -7.0, 0.6)),  # pickets
        ("surroundings", (10.0, -12.0, 0.6), (10.0, -7.0, 0.6)),  # bars
        ("surroundings", (0.0, -12.0, 5.0), (0.0, -7.0, 5.0)),  # a pole
        ("surroundings", (-6.0, -12.0, 6.1), (-6.0, -7.0, 6.1)),  # the wire at its lowest, 0.4 m below its ends
        ("house", (-3.0, -5.6, 5.0), (-3.0, -5.6, 1.0)),  # from above onto an awning
        ("house", (3.0, -5.6, 5.0), (3.0, -5.6, 1.0)),  # and onto a flat one
        ("house", (1.5, -7.0, 2.8), (1.5, -5.4, 2.8)),  # the sign that stands out
    ],
)
def test_a_drone_that_flies_into_it_is_stopped(
    built: SceneMesh, what: str, start: tuple[float, float, float], end: tuple[float, float, float]
) -> None:
    world = World(Blueprint([solid for solid in built.solids if len(solid.faces)], 60.0, 15.0), 0.25)
    try:
        assert world.sweep(start, end).hit == what
    finally:
        world.close()


def test_between_two_wires_and_under_one_the_way_is_free(built: SceneMesh) -> None:
    world = World(Blueprint([solid for solid in built.solids if len(solid.faces)], 60.0, 15.0), 0.25)
    try:
        assert world.sweep((-6.0, -12.0, 5.7), (-6.0, -7.0, 5.7)).hit is None
    finally:
        world.close()


def test_windows_that_are_not_there_are_said_with_whose_they_would_be() -> None:
    shop = {"awnings": [{"facade": 0, "column": 2, "columns": 4}], "signs": []}
    with pytest.raises(ValueError, match="awning 0 of building house: facade 0 of building house has 3 window columns"):
        build_scene(furnished(shop=shop))


def test_letters_fit_into_their_board_and_face_the_street() -> None:
    for text in ("Bäckerei", "薬局", "i"):
        low, high = letters(text, 2.0, 0.3, "#ffffff").bounds
        size = high - low
        assert size[1] <= 2.0 + 1e-5
        assert size[2] <= 0.3 + 1e-5
        assert max(size[1] / 2.0, size[2] / 0.3) == pytest.approx(1.0, abs=1e-4)


def wires_seen(gl: GlRenderer, sensors: str, before: str) -> float:
    """The share of a 20 mm wire's pixels, five metres off, that depth gives as near as the wire is."""
    wire = {"wires": [{"start": {"x": -8, "y": -10, "z": 5}, "end": {"x": 8, "y": -10, "z": 5}, "sag_m": 0.2}]}
    nothing = {name: [] for name in GROUND if name != "half_size_m"}
    away = {"house": pi / 2, "sky": -pi / 2}[before]
    pose = Pose(x=0.0, y=-15.0 if before == "house" else -5.5, z=4.8, yaw=away)
    views = drawn(gl, build_scene(furnished(ground=nothing | wire, shop={})), pose)
    drawn_m = views.depth_units[0] * 0.002
    wires = (drawn_m > 4.2) & (drawn_m < 5.3)
    wires[wires.shape[0] // 2 + 20 :] = False  # there the ground is as near
    assert wires.sum() > 100
    (frame,) = frames_of(views)
    depth = shipped_sensors(sensors).depth
    assert isinstance(depth, StereoDepth | TimeOfFlightDepth)
    whole = depth.model_copy(update={"partial_frames": 0.0})
    measured_m = sensed_depth(frame, whole, generator((1, 2), 1, "front")) * 0.002
    return float((np.abs(measured_m - drawn_m)[wires] < 0.5).mean())


@pytest.mark.parametrize("before", ["house", "sky"])
def test_real_depth_loses_most_of_a_wire(gl: GlRenderer, before: str) -> None:
    for sensors in ("d455", "d435"):
        assert wires_seen(gl, sensors, before) < 0.5, sensors


def painted_and_reflecting(
    gl: GlRenderer, pose: Pose, traffic: Sequence[dict[str, Any]] = (), **light: object
) -> tuple[RenderedViews, RenderedViews]:
    """Of a house without curtains and with panes nearly flush with the wall."""
    yard = bare().model_dump(mode="json") | {"traffic": traffic}
    yard["buildings"][0]["windows"] |= {"curtains": 0.0, "reveal_m": 0.05}
    painted, reflecting = (
        drawn(gl, build_scene(Scene.model_validate(yard | {"light": light | {"glass": glass}})), pose)
        for glass in ("painted", "reflecting")
    )
    return painted, reflecting


@pytest.mark.parametrize("light", [{}, {"sky": "night", "lit_windows": 0.4}])
@pytest.mark.parametrize("traffic", [[], [WALKER]], ids=["empty street", "somebody walks"])
def test_glass_that_reflects_changes_panes_and_nothing_else(
    gl: GlRenderer, light: dict[str, Any], traffic: list[dict[str, Any]]
) -> None:
    painted, reflecting = painted_and_reflecting(gl, LOOK, traffic, **light)
    assert painted.panes is not None
    assert painted.ids is not None
    assert reflecting.ids is not None
    changed = (painted.rgb[0] != reflecting.rgb[0]).any(axis=2)
    assert changed[painted.panes[0]].mean() > 0.5
    assert not changed[~painted.panes[0]].any()
    assert np.array_equal(painted.depth_units[0], reflecting.depth_units[0])
    assert np.array_equal(painted.ids[0], reflecting.ids[0])


def test_glass_seen_along_the_wall_shows_more_of_the_sky_than_from_before_it(gl: GlRenderer) -> None:
    brighter = []
    for pose in (Pose(x=0.0, y=-9.0, z=2.0, yaw=pi / 2), Pose(x=-4.5, y=-5.7, z=2.0, yaw=-0.5)):
        painted, reflecting = painted_and_reflecting(gl, pose, sky="overcast")
        assert painted.panes is not None
        at = painted.panes[0]
        at[at.shape[0] // 2 :] = False  # what is below the eye mirrors the ground
        assert at.sum() > 50
        linear = [(views.rgb[0][at] / 255.0) ** 2 for views in (painted, reflecting)]
        brighter.append(float((linear[1] - linear[0]).mean()))
    assert brighter[0] > 0.02
    assert brighter[1] > 1.4 * brighter[0]


@pytest.mark.parametrize(
    "ground",
    [
        {"hedges": [{"start": {"x": 9000, "y": 0}, "end": {"x": 9003, "y": 0}}]},
        {"poles": [{"position": {"x": 0, "y": -9000}}]},
        {"wires": [{"start": {"x": 9000, "y": 0, "z": 6}, "end": {"x": 9020, "y": 0, "z": 6}}]},
    ],
)
def test_furniture_beyond_the_ground_is_refused(ground: dict) -> None:
    yard = make_yard()
    scene = yard.model_copy(update={"ground": Ground.model_validate(yard.ground.model_dump() | ground)})
    with pytest.raises(BadQuestion, match=r"lies outside; the ground ends at"):
        check(scene)
