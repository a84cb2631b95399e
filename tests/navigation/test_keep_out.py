"""Volumes that nothing may fly into: legs held against them, and as obstacles of whoever plans."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from navigation.camera import Place
from navigation.keep_out import Volume, _side_near, entered, surfaces

ROOM_M = 0.5
WIRE = Volume("wire", ((-20.0, 4.5), (20.0, 4.5), (20.0, 5.5), (-20.0, 5.5)), 5.0, 7.0)
YARD = Volume("yard", ((0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (5.0, 3.0), (0.0, 10.0)), 0.0, 30.0)


@pytest.mark.parametrize(
    ("a", "b", "stopped"),
    [
        ((0.0, 0.0, 6.0), (0.0, 10.0, 6.0), True),
        ((0.0, 0.0, 6.0), (0.0, 3.9, 6.0), False),
        ((0.0, 0.0, 6.0), (0.0, 4.1, 6.0), True),  # within the drone's room of it
        ((0.0, 0.0, 4.4), (0.0, 10.0, 4.4), False),  # below
        ((0.0, 0.0, 4.6), (0.0, 10.0, 4.6), True),
        ((0.0, 0.0, 8.0), (0.0, 10.0, 8.0), False),  # above
        ((0.0, 0.0, 2.0), (0.0, 10.0, 12.0), True),
        ((0.0, 0.0, 8.0), (0.0, 10.0, 28.0), False),
        ((0.0, 5.0, 1.0), (0.0, 5.0, 20.0), True),  # straight up through it
        ((0.0, 5.0, 1.0), (0.0, 5.0, 4.0), False),
        ((21.0, 0.0, 6.0), (21.0, 10.0, 6.0), False),  # past its end
    ],
)
def test_a_leg_stays_out_of_a_volume_by_the_drones_room(a: tuple, b: tuple, stopped: bool) -> None:
    found = entered(Place(*a), Place(*b), [WIRE], ROOM_M)
    assert (found is not None) == stopped
    if found is not None:
        assert found.name == "wire"


def test_a_volume_need_not_be_convex() -> None:
    assert entered(Place(5.0, 12.0, 3.0), Place(5.0, 5.0, 3.0), [YARD], ROOM_M) is None
    assert entered(Place(5.0, 12.0, 3.0), Place(5.0, 3.2, 3.0), [YARD], ROOM_M) is not None


def test_who_is_in_a_volume_may_leave_it_straight_and_go_no_farther_in() -> None:
    here = Place(0.0, 4.2, 6.0)
    assert entered(here, Place(0.0, 2.0, 6.0), [WIRE], ROOM_M) is None
    assert entered(here, Place(0.0, 4.2, 8.0), [WIRE], ROOM_M) is None
    assert entered(here, Place(0.0, 4.3, 6.0), [WIRE], ROOM_M) is not None
    assert entered(here, Place(3.0, 4.2, 6.0), [WIRE], ROOM_M) is not None
    below = Place(0.0, 5.0, 4.8)
    assert entered(below, Place(0.0, 5.0, 3.0), [WIRE], ROOM_M) is None
    assert entered(below, Place(0.0, 5.0, 9.0), [WIRE], ROOM_M) is not None


STARS = st.builds(
    lambda spokes, x, y, low, tall: Volume(
        "star",
        tuple((x + r * math.cos(k), y + r * math.sin(k)) for k, r in zip(_turns(len(spokes)), spokes, strict=True)),
        low,
        low + tall,
    ),
    st.lists(st.floats(0.4, 8.0), min_size=3, max_size=7),
    st.floats(-6.0, 6.0),
    st.floats(-6.0, 6.0),
    st.floats(-2.0, 8.0),
    st.floats(0.2, 8.0),
)
PLACES = st.builds(Place, st.floats(-15.0, 15.0), st.floats(-15.0, 15.0), st.floats(0.0, 15.0))


def _turns(count: int) -> np.ndarray:
    return np.arange(count) * math.tau / count


def _away_m(places: np.ndarray, volume: Volume) -> np.ndarray:
    """Of places (N, 3), on the plan; inf above the ceiling and below the floor. Who is on either is in the volume."""
    away = shapely.distance(shapely.points(places[:, :2]), shapely.Polygon(volume.outline))
    level = (places[:, 2] >= volume.floor_m - 1e-6) & (places[:, 2] <= volume.ceiling_m + 1e-6)
    return np.where(level, away, np.inf)


def _is_clear(place: Place, volume: Volume, room_m: float) -> bool:
    """Whoever is nearer than the room, from above or below as well, may leave."""
    away = shapely.distance(shapely.Point(place.x, place.y), shapely.Polygon(volume.outline))
    return bool(max(away, volume.floor_m - place.z, place.z - volume.ceiling_m) >= room_m)


@settings(max_examples=150, derandomize=True, deadline=None)
@given(STARS, st.lists(PLACES, min_size=2, max_size=5), st.floats(0.1, 1.5))
def test_no_leg_that_is_let_happen_comes_nearer_to_a_volume_than_the_room(
    volume: Volume, corners: list[Place], room_m: float
) -> None:
    here = corners[0]
    for there in corners[1:]:
        along = np.linspace(np.array(here), np.array(there), 60)
        away = _away_m(along, volume)
        if entered(here, there, [volume], room_m) is None and _is_clear(here, volume, room_m):
            assert away.min() >= room_m - 1e-6
        here = there


def test_for_a_planner_a_volume_has_sides_a_floor_and_a_ceiling() -> None:
    points = surfaces([WIRE], Place(0.0, 0.0, 6.0))
    assert np.hypot(points[:, 0], points[:, 1]).max() < 29.0
    assert points[:, 2].min() == 5.0
    assert points[:, 2].max() == 7.0
    for at in ((3.0, 4.5, 6.1), (3.0, 5.0, 5.0), (3.0, 5.0, 7.0)):
        assert np.linalg.norm(points - np.array(at), axis=1).min() < 0.3
    assert not len(surfaces([WIRE], Place(0.0, 200.0, 6.0)))


@pytest.mark.parametrize("turned", [0.0, 0.3])
def test_of_a_volume_of_twenty_kilometres_the_same_is_taken_near_by_as_of_all_of_it(turned: float) -> None:
    east, north = math.cos(turned), math.sin(turned)
    plan = ((-10_000.0, 4.5), (10_000.0, 4.5), (10_000.0, 5.5), (-10_000.0, 5.5))
    outline = tuple((x * east - y * north, x * north + y * east) for x, y in plan)
    points = surfaces([Volume("long", outline, 5.0, 7.0)], Place(0.0, 0.0, 6.0))
    assert 2_500 < len(points) < 6_000
    for (ax, ay), (bx, by) in zip(outline[::2], outline[1::2], strict=True):
        share = np.linspace(0.0, 1.0, 80_001)[:, None]
        side = np.hstack([np.array((ax, ay)) + share * np.array((bx - ax, by - ay)), np.full((80_001, 1), 6.0)])
        for place in side[np.linalg.norm(side - (0.0, 0.0, 6.0), axis=1) <= 20.0]:
            assert np.linalg.norm(points - place, axis=1).min() < 0.13


def test_a_side_far_longer_than_what_is_near_gives_no_more_places_than_lie_there() -> None:
    a, b = np.array((-10_000.0, 3.0)), np.array((10_000.0, 4.0))
    assert 159 <= len(_side_near(a, b, Place(0.0, 0.0, 5.0))) <= 161
    assert not len(_side_near(a, b, Place(0.0, 40.0, 5.0)))
    assert not len(_side_near(np.array((30.0, -5.0)), np.array((30.0, 5.0)), Place(0.0, 0.0, 5.0)))


def test_volumes_that_lie_on_each_other_give_the_points_of_one() -> None:
    here = Place(0.0, 0.0, 6.0)
    assert len(surfaces([WIRE] * 32, here)) == len(surfaces([WIRE], here))
