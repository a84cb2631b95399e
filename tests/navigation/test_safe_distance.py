"""Eq. 7 by hand, and the corridor against a ray-cast world."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from navigation.camera import DepthView, Pose, pinhole
from navigation.safe_distance import MarkedPoint, SafeDistanceParameters, body_radius_m, corridor, safe_distances
from tests.navigation import usual
from tests.navigation.raycast_world import Prism, World, rectangle

NORTH = math.pi / 2
BARE = usual.SAFE_DISTANCE._replace(variant="bare")


def _flat(depth_m: float, size: int = 60, heading_deg: float = 0.0) -> DepthView:
    return DepthView(pinhole(size, size, 90.0, heading_deg), np.full((size, size), depth_m, np.float32))


def _look(
    world: World, pose: Pose, choice: SafeDistanceParameters, heading: int = 0, size: int = 120
) -> tuple[MarkedPoint, ...]:
    views = world.views(pose, pinhole(size, size, 90.0))
    return safe_distances(views[heading], [view for h, view in views.items() if h != heading], choice)


def test_the_five_points_stand_at_sixths_of_the_width_on_the_middle_row() -> None:
    marked = safe_distances(_flat(5.0), (), BARE)
    assert [point.label for point in marked] == ["a", "b", "c", "d", "e"]
    np.testing.assert_allclose([point.x for point in marked], [1 / 6, 2 / 6, 3 / 6, 4 / 6, 5 / 6])
    assert {point.y for point in marked} == {0.5}
    expected = [math.degrees(math.atan(x)) for x in (-2 / 3, -1 / 3, 0.0, 1 / 3, 2 / 3)]
    np.testing.assert_allclose([point.bearing_deg for point in marked], expected, atol=1e-12)


def test_bearings_are_relative_to_the_nose_in_every_view() -> None:
    marked = safe_distances(_flat(5.0, heading_deg=-45.0), (), BARE)
    assert marked[2].bearing_deg == -45.0


def test_bare_eq7_is_the_pixels_distance_up_to_l_max() -> None:
    """Depth 6 m: straight ahead 6 m, at x = W/6 it is 6 / cos(33.69 deg) = 6 sqrt(1 + 4/9) = 7.211 m."""
    distances = [point.corridor.distance_m for point in safe_distances(_flat(6.0), (), BARE)]
    a, b = 6.0 * math.sqrt(1 + 4 / 9), 6.0 * math.sqrt(1 + 1 / 9)
    np.testing.assert_allclose(distances, [a, b, 6.0, b, a])
    capped = safe_distances(_flat(6.0), (), BARE._replace(l_max_m=7.0))
    np.testing.assert_allclose([p.corridor.distance_m for p in capped], [7.0, b, 6.0, b, 7.0])


def test_bare_eq7_without_a_return_is_l_max_and_an_invalid_pixel_is_no_way() -> None:
    assert safe_distances(_flat(math.inf), (), BARE)[2].corridor == (10.0, None, 0.0)
    assert safe_distances(_flat(math.nan), (), BARE)[2].corridor == (0.0, None, 0.0)


def test_the_corridor_stops_a_radius_and_a_clearance_before_a_wall_straight_ahead() -> None:
    """A point on the way stops the ball of 0.35 + 1.5 m exactly that far before it: 8 - 1.85 = 6.15 m."""
    marked = safe_distances(_flat(8.0, 121), (), usual.SAFE_DISTANCE)
    assert marked[2].corridor.distance_m == pytest.approx(6.15, abs=0.01)
    assert marked[2].corridor.nearest_return_m == pytest.approx(8.0)
    assert marked[2].corridor.half_width_m == 1.85


def test_a_wall_met_at_a_slant_stops_the_ball_by_its_side() -> None:
    """Towards a wall 8 m ahead at bearing b the ball of radius r touches after (8 - r) / cos b."""
    point = safe_distances(_flat(8.0, 240), (_flat(8.0, 240),), usual.SAFE_DISTANCE)[3]
    assert point.corridor.distance_m == pytest.approx((8.0 - 1.85) * math.sqrt(1 + 1 / 9), abs=0.03)


def test_a_post_beside_the_line_of_sight_stops_the_corridor_but_not_the_bare_formula() -> None:
    world = World([Prism(rectangle(0.8, 6.0, 0.2, 0.2))])
    pose = Pose(0.0, 0.0, 5.0, NORTH)
    assert _look(world, pose, BARE)[2].corridor.distance_m == 10.0
    stopped = _look(world, pose, usual.SAFE_DISTANCE)[2].corridor
    assert stopped.distance_m == pytest.approx(5.9 - math.sqrt(1.85**2 - 0.7**2), abs=0.05)


@pytest.mark.parametrize(("bottom", "top"), [(6.0, 6.3), (3.8, 4.2)], ids=["eaves above", "a railing below"])
def test_a_ledge_off_the_middle_row_stops_the_corridor(bottom: float, top: float) -> None:
    world = World([Prism(rectangle(0.0, 8.0, 6.0, 1.0), bottom, top)])
    pose = Pose(0.0, 0.0, 5.0, NORTH)
    assert _look(world, pose, BARE)[2].corridor.distance_m == 10.0
    gap = max(bottom - 5.0, 5.0 - top)
    expected = 7.5 - math.sqrt(1.85**2 - gap**2)
    assert _look(world, pose, usual.SAFE_DISTANCE)[2].corridor.distance_m == pytest.approx(expected, abs=0.15)


def test_a_wall_outside_the_picture_is_seen_by_the_neighbouring_camera() -> None:
    world = World([Prism(rectangle(-3.06, 2.57, 0.3, 0.3))])  # 4 m away at -50 degrees
    pose = Pose(0.0, 0.0, 5.0, NORTH)
    view = world.views(pose, pinhole(120, 120, 90.0))
    alone = safe_distances(view[0], (), usual.SAFE_DISTANCE)[0].corridor.distance_m
    together = safe_distances(view[0], (view[-45],), usual.SAFE_DISTANCE)[0].corridor.distance_m
    assert alone == 10.0
    assert together == pytest.approx(3.84 - math.sqrt(1.85**2 - 1.1**2), abs=0.25)


def test_in_a_tight_place_the_drone_may_leave_along_the_wall_but_not_into_it() -> None:
    world = World([Prism(((1.2, -50.0), (60.0, -50.0), (60.0, 50.0), (1.2, 50.0)))])  # a wall 1.2 m to the right
    marked = _look(world, Pose(0.0, 0.0, 5.0, NORTH), usual.SAFE_DISTANCE)
    assert marked[2].corridor.half_width_m == pytest.approx(0.95 * 1.2, abs=0.01)
    assert marked[2].corridor.distance_m == 10.0
    assert marked[4].corridor.distance_m == pytest.approx(0.0, abs=0.2)


def test_the_body_never_shrinks_below_the_tight_clearance() -> None:
    at_arms_length = np.array([[0.5, 0.0, 0.0]], np.float32)
    assert body_radius_m(at_arms_length, usual.SAFE_DISTANCE) == pytest.approx(0.85)
    assert corridor(at_arms_length, 0.0, 0.85, 10.0).distance_m == 0.0
    assert corridor(at_arms_length, 180.0, 0.85, 10.0).distance_m == 10.0


def test_a_point_whose_neighbourhood_is_invalid_is_no_way() -> None:
    view = _flat(math.inf, 80)
    view.depth_m[:, 38:42] = np.nan
    distances = [point.corridor.distance_m for point in safe_distances(view, (), usual.SAFE_DISTANCE)]
    assert distances == [10.0, 10.0, 0.0, 10.0, 10.0]


def test_mirrored_depth_gives_mirrored_distances() -> None:
    depth = np.random.default_rng(3).uniform(2.0, 30.0, (60, 60)).astype(np.float32)
    straight = safe_distances(DepthView(pinhole(60, 60, 90.0, 45.0), depth), (), usual.SAFE_DISTANCE)
    mirrored = safe_distances(DepthView(pinhole(60, 60, 90.0, -45.0), depth[:, ::-1]), (), usual.SAFE_DISTANCE)
    for one, other in zip(straight, reversed(mirrored), strict=True):
        assert one.bearing_deg == pytest.approx(-other.bearing_deg)
        assert one.corridor.distance_m == pytest.approx(other.corridor.distance_m, abs=1e-4)


_BLOCK = st.tuples(
    st.floats(-14, 14), st.floats(-14, 14), st.floats(0.4, 8), st.floats(0.4, 8), st.floats(0, 9), st.floats(0.4, 6)
)


@settings(max_examples=25, deadline=None)
@given(st.lists(_BLOCK, min_size=1, max_size=5), st.sampled_from((-90, -45, 0, 45, 90)), st.floats(-3.0, 3.0))
def test_the_corridor_is_never_longer_than_the_way_is_free(
    blocks: list[tuple[float, float, float, float, float, float]], heading: int, yaw: float
) -> None:
    world = World([Prism(rectangle(x, y, w, d), low, low + h) for x, y, w, d, low, h in blocks], ground=True)
    pose = Pose(0.0, 0.0, 5.0, yaw)
    assume(world.gap_m(np.array([pose[:3]]))[0] > 0.9)
    for point in _look(world, pose, usual.SAFE_DISTANCE, heading):
        assume(abs(point.bearing_deg) <= 90.0)  # behind that there is no camera
        free = world.free_m(pose, point.bearing_deg, 0.35, 10.0)
        assert 0.0 <= point.corridor.distance_m <= free
        roomy = world.free_m(pose, point.bearing_deg, point.corridor.half_width_m + 0.02, 10.0)
        assert point.corridor.distance_m >= roomy - 0.05  # and no shorter than the grown ball's way
