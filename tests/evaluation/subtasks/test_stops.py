"""Stops are drawn from the task alone, clear of walls, and where their names say."""

import math

import numpy as np

from contracts.scene_layout import floor_outline
from evaluation.scene_generator.footprints import distance_to_outline
from evaluation.subtasks.stops import CLEAR_M, RING_M, before_goal, before_start, is_clear, on_lap
from tests.evaluation.evaluation_kit import a_task

TASK = a_task(facade=1)
OUTLINE = floor_outline(TASK.scene.building("home"), 1)


def rng(seed: int = 1) -> np.random.Generator:
    return np.random.default_rng(seed)


def test_stops_before_the_goal_have_its_window_in_one_of_the_five_views() -> None:
    stops = before_goal(TASK, 30, rng())
    assert len(stops) == 30
    for stop in stops:
        bearing = math.atan2(TASK.target.y - stop.y, TASK.target.x - stop.x) - stop.yaw
        assert abs(math.remainder(bearing, math.tau)) < math.radians(131)
        assert stop.x > 20.0 + CLEAR_M - 1e-9  # facade 1 faces east
        assert is_clear(TASK.scene, stop.x, stop.y)


def test_stops_on_a_lap_keep_the_building_on_the_right() -> None:
    for stop in on_lap(TASK, 30, rng()):
        away = distance_to_outline((stop.x, stop.y), OUTLINE)
        assert CLEAR_M <= away <= RING_M[1]
        right = (stop.x + 30 * math.sin(stop.yaw), stop.y - 30 * math.cos(stop.yaw))
        left = (stop.x - 30 * math.sin(stop.yaw), stop.y + 30 * math.cos(stop.yaw))
        assert distance_to_outline(right, OUTLINE) < distance_to_outline(left, OUTLINE)


def test_floors_are_counted_from_the_middles_of_the_bands_first() -> None:
    # 9 m off a wall of 15 m: one band, looked at from 9 m height
    stops = before_start(TASK, 3, rng())
    assert stops[0].z == 9.0
    assert len(stops) == 3
    assert {(stop.x, stop.y) for stop in stops} == {(10.0, -9.0)}


def test_equal_seeds_draw_equal_stops() -> None:
    assert before_goal(TASK, 5, rng(4)) == before_goal(TASK, 5, rng(4))
    assert on_lap(TASK, 5, rng(4)) != on_lap(TASK, 5, rng(5))
