"""Boxes of one look that are of one thing: parts, and the same thing in two cameras."""

import math

import pytest

from contracts.geometry import Box, Pose
from contracts.vlm_gateway import Match
from mission.looks import Look, look_of
from mission.one_thing import clearest, joined
from mission.sighting import Sighting, locate
from tests.mission.block import Block
from tests.mission.block_vehicle import BlockWorld
from tests.mission.box_world import block_placement


async def eight_metres_before_the_wall() -> Look:
    """Eye to eye with a wall from x -8 to 8: 0.1 of a picture's width is 1.6 m of it."""
    vehicle = await block_placement(BlockWorld(Block(start=Pose(x=0, y=-14, z=9, yaw=math.pi / 2)))).begin("look")
    return look_of(await vehicle.observe(), ())


def match(x_min: float, x_max: float, confidence: float = 0.9, camera: str = "front") -> Match:
    return Match(camera=camera, box=Box(x_min=x_min, y_min=0.47, x_max=x_max, y_max=0.53), confidence=confidence)


def located(look: Look, *matches: Match) -> list[Sighting]:
    return [locate(m, look.sights[m.camera], floor_z=9.0, floor_height_m=3.0) for m in matches]


async def test_the_parts_of_a_poster_are_one_poster_as_sure_as_the_surest_part() -> None:
    look = await eight_metres_before_the_wall()
    whole = joined([match(0.46, 0.50, 0.4), match(0.49, 0.54, 0.95)], look.sights["front"])
    assert whole == [match(0.46, 0.54, 0.95)]


async def test_things_at_two_windows_stay_two_things() -> None:
    look = await eight_metres_before_the_wall()
    two = [match(0.42, 0.47, 0.9), match(0.58, 0.63, 0.8)]
    assert joined(two, look.sights["front"]) == two


async def test_boxes_that_touch_are_not_one_thing_where_that_would_be_larger_than_anything_asked_for() -> None:
    look = await eight_metres_before_the_wall()
    three = [match(0.41, 0.47), match(0.47, 0.53), match(0.53, 0.59)]
    assert len(joined(three, look.sights["front"])) == 2


async def test_what_stands_behind_a_thing_is_no_part_of_it() -> None:
    look = await eight_metres_before_the_wall()
    # the wall ends at x = 8 m; beside it the picture shows the ground far behind, a little lower
    low = Box(x_min=0.98, y_min=0.70, x_max=1.0, y_max=0.75)
    wall = Box(x_min=0.93, y_min=0.69, x_max=0.985, y_max=0.75)
    matches = [Match(camera="front", box=box) for box in (wall, low)]
    sight = look.sights["front"]
    sight.depth_m[:, -3:] *= 1.5
    assert len(joined(matches, sight)) == 2


async def test_a_box_without_depth_is_joined_to_nothing() -> None:
    look = await eight_metres_before_the_wall()
    sky = Match(camera="front", box=Box(x_min=0.4, y_min=0.0, x_max=0.5, y_max=0.01))
    assert sky in joined([sky, match(0.46, 0.54)], look.sights["front"])


async def test_of_two_cameras_the_one_that_shows_the_whole_thing_tells_its_place_and_how_sure_the_look_is() -> None:
    look = await eight_metres_before_the_wall()
    # 45 degrees to the right of front-left's axis is the picture's edge, which cuts the thing off
    cut = Match(camera="front-left", box=Box(x_min=0.96, y_min=0.47, x_max=1.0, y_max=0.53), confidence=0.99)
    sightings = located(look, cut, match(0.46, 0.54, 0.7))
    best = clearest(sightings, sightings[0])
    assert best.match == match(0.46, 0.54, 0.7)
    assert best.place is not None
    assert (best.place.x, best.place.y) == pytest.approx((0.0, -6.0), abs=0.02)


async def test_a_thing_at_another_window_is_not_taken_for_a_clearer_sight_of_this_one() -> None:
    look = await eight_metres_before_the_wall()
    aside, middle = located(look, match(0.64, 0.72, 0.8), match(0.46, 0.54, 0.9))
    assert clearest([middle, aside], aside) == aside
