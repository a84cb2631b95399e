"""Meshes and primitives: closed, turned outwards, the right size."""

from math import pi

import numpy as np
import pytest

from services.sim.geometry.mesh import Mesh, concatenate, empty
from services.sim.geometry.solids import box, cone, cylinder, ellipsoid, extruded, frustum, plate, polygon, prism
from services.sim.geometry.tubes import tube

_L = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]


def volume(mesh: Mesh) -> float:
    """By the divergence theorem: right only when the surface is closed and all faces look outwards."""
    p = mesh.positions.astype(np.float64)[mesh.faces]
    return float(np.einsum("ij,ij->i", p[:, 0], np.cross(p[:, 1], p[:, 2])).sum() / 6)


@pytest.mark.parametrize(
    ("mesh", "expected"),
    [
        (box((1, 2, 3), (5, 6, 7)), 6.0),
        (prism(_L, 1, 3, bottom=True), 6.0),
        (extruded([(0, 0), (1, 0), (1, 1)], 0.5), 0.25),
        (cylinder(1, 2, segments=96), 2 * pi),
        (cone(1, 3, segments=96), pi),
        (frustum(2, 1, 3, segments=96), pi * 7),
        (ellipsoid((1, 2, 3), (4, 4, 4), 96, 48), 8 * pi),
        (tube([(0, 0, 0), (0, 0, 4)], 0.5, 64), pi),
        (tube([(3 * np.cos(a), 3 * np.sin(a), 0) for a in np.arange(0, 2 * pi, pi / 48)], 0.5, 48, closed=True), 14.80),
    ],
)
def test_primitives_are_closed_and_hold_their_volume(mesh: Mesh, expected: float) -> None:
    assert volume(mesh) == pytest.approx(expected, rel=0.01)


def test_a_mirrored_mesh_still_looks_outwards() -> None:
    assert volume(box((1, 2, 3)).transformed(scale=(1, -1, 1))) == pytest.approx(6.0)
    assert volume(box((1, 2, 3)).flipped()) == pytest.approx(-6.0)


def test_normals_stay_upright_on_a_stretched_mesh() -> None:
    mesh = ellipsoid(1.0).transformed(scale=(1, 1, 5), yaw=0.3, move=(1, 2, 3))
    assert np.linalg.norm(mesh.normals, axis=1) == pytest.approx(1.0, abs=1e-5)
    corners = mesh.positions[mesh.faces].astype(np.float64)
    face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.einsum("ij,ij->i", face, mesh.normals[mesh.faces].mean(axis=1)) > 0).all()


def test_turning_by_yaw_runs_counter_clockwise_seen_from_above() -> None:
    turned = box((1, 1, 1), (5, 0, 0)).transformed(yaw=pi / 2)
    assert turned.positions.mean(axis=0) == pytest.approx([0, 5, 0], abs=1e-5)


def test_a_plate_faces_its_front_with_its_picture_upright() -> None:
    mesh = plate(2.0, 1.0)
    assert (mesh.normals == [1, 0, 0]).all()
    lower_left = mesh.positions[(mesh.uv == [0, 0]).all(axis=1)][0]
    assert lower_left.tolist() == [0.0, -1.0, -0.5]


def test_an_outline_is_filled_whatever_its_shape() -> None:
    mesh = polygon(_L, 2.0)
    p = mesh.positions[mesh.faces].astype(np.float64)
    areas = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])[:, 2] / 2
    assert (areas > 0).all()
    assert areas.sum() == pytest.approx(3.0)


def test_joining_keeps_every_triangle() -> None:
    both = concatenate([box((1, 1, 1)), empty(), box((1, 1, 1), (9, 0, 0))])
    assert both.triangle_count == 24
    assert volume(both) == pytest.approx(2.0)


def test_a_colour_that_is_none_is_refused() -> None:
    with pytest.raises(ValueError, match="#rrggbb"):
        box((1, 1, 1), colour="red")
