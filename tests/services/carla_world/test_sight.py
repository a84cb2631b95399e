"""Lines of sight by depth."""

import pytest

from episode_kit.judge import Thing
from services.carla_world.sight import DepthSight
from tests.services.carla_world.boxes import Box, BoxWorld

HERE = (0.0, 0.0, 2.0)
WALL = Box((10.0, -8.0, 0.0), (11.0, 8.0, 9.0))
POINTS = [(9.97, y, z) for y in (-0.4, 0.0, 0.4) for z in (1.6, 2.0, 2.4)]


def test_what_lies_on_the_wall_is_seen() -> None:
    world = BoxWorld(WALL)
    assert DepthSight(world.look, {}).first_hits(HERE, POINTS) == [None] * 9
    assert world.looks == 1


def test_what_stands_between_hides_what_is_behind_it_alone() -> None:
    post = Box((5.0, -0.1, 0.0), (5.2, 0.1, 9.0))
    hits = DepthSight(BoxWorld(WALL, post).look, {}).first_hits(HERE, POINTS)
    assert [hit is not None for hit in hits] == [False] * 3 + [True] * 3 + [False] * 3


def test_a_thing_of_the_scene_is_told_by_its_number() -> None:
    pot = Box((9.4, -0.2, 1.8), (9.8, 0.2, 2.2))
    things = {"pot": Thing(7, (9.6, 0.0, 2.0)), "other": Thing(8, (9.6, 5.0, 2.0))}
    (hit,) = DepthSight(BoxWorld(WALL, pot).look, things).first_hits(HERE, [(9.97, 0.0, 2.0)])
    assert hit is not None
    assert hit.part == 7


@pytest.mark.parametrize("end", [(-6.0, 0.0, 2.0), (0.0, 0.0, 8.0), (0.0, 0.0, -3.0)])
def test_places_all_round_are_looked_at_one_by_one(end: tuple[float, float, float]) -> None:
    world = BoxWorld(Box((-4.0, -9.0, 4.0), (4.0, 9.0, 5.0)))
    hits = DepthSight(world.look, {}).first_hits(HERE, [(9.0, 0.0, 2.0), end])
    assert hits[0] is None
    assert (hits[1] is not None) == (end[2] > 4.0)
