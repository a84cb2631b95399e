"""The explorer's steps in ray-cast worlds, its memory as bytes, and its end."""

import math

import numpy as np
import pytest

from evaluation.task_set.task_files import shipped
from navigation.camera import DepthView, Pose, pinhole
from navigation.explorer import map_codec
from navigation.explorer.explore import CUT_LIFTED, NoFacade, explore
from navigation.explorer.map import CELL_M, OCCUPIED
from navigation.keep_out import Volume
from tests.load.explorer_study import Flight, contour, figures, fly, paper
from tests.navigation import usual
from tests.navigation.explorer_worlds import make_task
from tests.navigation.raycast_world import Prism, World, rectangle
from tests.navigation.scene_worlds import from_scene

HERE = Pose(0.0, 0.0, 8.0, math.pi / 2)
HOUSE = World([Prism(rectangle(0.0, 14.0, 16.0, 10.0))])
CAMERA = pinhole(160, 24, 90.0)


def _views(pose: Pose = HERE, world: World = HOUSE) -> tuple[DepthView, ...]:
    return tuple(world.views(pose, CAMERA).values())


def _search(name: str, **options: object) -> Flight:
    shape, around, seed = name.split("-")
    return fly(
        make_task(shape, around, int(seed), bool(options.pop("balconies", False))),
        contour(usual.EXPLORER),
        **options,
    )


@pytest.mark.parametrize("name", ["rectangle-ring-1", "l-street-2", "u-none-3", "plus-ring-1", "octagon-street-2"])
def test_the_window_is_found_and_nothing_is_touched(name: str) -> None:
    flight = _search(name)
    assert flight.found
    assert not flight.collided
    assert flight.steps <= 20


def test_balconies_do_not_keep_it_from_finding_the_window() -> None:
    flight = _search("t-street-4", balconies=True)
    assert flight.found
    assert not flight.collided


def test_without_the_window_the_search_ends_with_nearly_all_of_the_facade_inspected() -> None:
    flight = _search("rectangle-street-2", absent=True)
    assert flight.over
    assert not flight.found
    assert flight.covered > 0.97


def test_a_t_shaped_house_with_balconies_shows_every_window_before_the_search_ends() -> None:
    flight = fly(from_scene(shipped("vld-300").task("vld-300-031")), contour(usual.EXPLORER), absent=True)
    assert flight.over
    assert not flight.collided
    assert all(flight.in_view)


def test_where_neighbours_stand_it_finds_more_than_the_papers_rule() -> None:
    tasks = [make_task("plus", "ring", seed) for seed in (10, 11)]
    ours = figures([fly(task, contour(usual.EXPLORER)) for task in tasks])
    theirs = figures([fly(task, paper()) for task in tasks])
    assert not ours["failed"]
    assert theirs["failed"]


def test_the_memory_is_the_same_after_being_bytes() -> None:
    memory = explore(None, _views(), HERE, usual.EXPLORER).memory
    again = map_codec.from_bytes(map_codec.to_bytes(memory))
    assert again._replace(map=memory.map) == memory
    assert all(np.array_equal(a, b) for a, b in zip(again.map, memory.map, strict=True))
    moved = Pose(*memory.stop, HERE.z, 2.0)
    one, other = (explore(m, _views(moved), moved, usual.EXPLORER).decision for m in (memory, again))
    assert one == other


def test_a_step_leaves_the_memory_it_was_given_as_it_was() -> None:
    memory = explore(None, _views(), HERE, usual.EXPLORER).memory
    before = map_codec.to_bytes(memory)
    moved = HERE._replace(x=4.0)
    explore(memory, _views(moved), moved, usual.EXPLORER)
    assert map_codec.to_bytes(memory) == before


@pytest.mark.parametrize(
    ("at", "byte", "said"),
    [(0, 88, "no explorer's map"), (4, 9, "version 9"), (6, 7, "cells of"), (12, 7, "header"), (100, 3, "cell")],
)
def test_bytes_that_no_step_left_behind_are_refused(at: int, byte: int, said: str) -> None:
    data = bytearray(map_codec.to_bytes(explore(None, _views(), HERE, usual.EXPLORER).memory))
    data[at] = byte
    with pytest.raises(map_codec.BadMemory, match=said):
        map_codec.from_bytes(bytes(data))
    with pytest.raises(map_codec.BadMemory, match="bytes, not"):
        map_codec.from_bytes(bytes(data[:-1]))


def test_without_a_wall_ahead_there_is_no_search() -> None:
    with pytest.raises(NoFacade, match="no wall"):
        explore(None, _views(world=World([])), HERE, usual.EXPLORER)


def test_a_drone_that_was_pushed_elsewhere_goes_on_from_where_it_is() -> None:
    memory = explore(None, _views(), HERE, usual.EXPLORER).memory
    pushed = Pose(-15.0, 14.0, 8.0, 0.0)
    step = explore(memory, _views(pushed), pushed, usual.EXPLORER)
    assert step.decision.status == "move"
    assert math.dist(step.decision.place, (pushed.x, pushed.y)) == pytest.approx(step.decision.distance_m, abs=1e-6)
    assert not step.memory.map.attempts[step.target].any()


@pytest.mark.parametrize(("detour_m", "lifted"), [(usual.EXPLORER.detour_m, True), (math.inf, False)])
def test_a_long_way_round_is_not_flown_where_the_cut_alone_bars_a_short_one(detour_m: float, lifted: bool) -> None:
    """All that is left lies round the right corner of the house, and the drone stands left of the cut."""
    memory = explore(None, _views(), HERE, usual.EXPLORER).memory
    grid = memory.map.copy()
    grid.inspected[grid.state == OCCUPIED] = True
    east = np.zeros_like(grid.expected)
    east[:, int((7.0 - grid.west_m) / CELL_M) :] = True
    grid.attempts[~east] = usual.EXPLORER.attempts
    grid.expected[~east] = False
    there = HERE._replace(x=-4.0)
    step = explore(memory._replace(map=grid), _views(there), there, usual.EXPLORER._replace(detour_m=detour_m))
    assert (step.memory.cut == CUT_LIFTED) is lifted
    assert (step.decision.way_m < 25.0) is lifted


def test_without_room_for_the_body_it_does_not_fly() -> None:
    beside = [Prism(rectangle(x, 0.0, 0.5, 20.0)) for x in (-1.3, 1.3)]
    tight = World([*HOUSE.prisms, *beside])
    decision = explore(None, _views(HERE, tight), HERE, usual.EXPLORER).decision
    assert decision.status == "done"
    assert "can't be reached" in decision.reason


def test_no_stop_lies_in_or_behind_a_volume_to_keep_out_of() -> None:
    free = explore(None, _views(), HERE, usual.EXPLORER).decision
    wires = [
        Volume("wire", ((x - 0.1, -40.0), (x + 0.1, -40.0), (x + 0.1, 40.0), (x - 0.1, 40.0)), 6.0, 9.0)
        for x in (-3.0, 3.0)
    ]
    assert abs(free.place[0]) > 3.0
    kept_out = explore(None, _views(), HERE, usual.EXPLORER, keep_out=wires).decision
    assert abs(kept_out.place[0]) < 2.5
    above = [wire._replace(floor_m=12.0, ceiling_m=13.0) for wire in wires]
    assert explore(None, _views(), HERE, usual.EXPLORER, keep_out=above).decision == free


def test_views_that_are_all_invalid_do_not_break_a_search_under_way() -> None:
    memory = explore(None, _views(), HERE, usual.EXPLORER).memory
    unseen = np.full((24, 160), np.nan, np.float32)
    blind = tuple(DepthView(CAMERA._replace(heading_deg=h), unseen) for h in (-90, 0, 90))
    step = explore(memory, blind, HERE, usual.EXPLORER)
    assert (step.decision.status, step.decision.reason) == ("turn", "the cameras show nothing")
    assert np.array_equal(step.memory.map.state, memory.map.state)


def test_the_way_does_not_lead_where_a_camera_looks_and_shows_nothing() -> None:
    views = _views()
    decision = explore(None, views, HERE, usual.EXPLORER).decision
    assert decision.status == "move"
    towards = decision.bearing_deg
    blinded = [
        view._replace(depth_m=np.full_like(view.depth_m, np.nan)) if abs(view.heading_deg - towards) < 80.0 else view
        for view in views
    ]
    again = explore(None, blinded, HERE, usual.EXPLORER).decision
    assert again.status != "move" or abs(again.bearing_deg - towards) > 30.0
