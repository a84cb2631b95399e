"""Sensors and their faults over HTTP: what an observation says of itself."""

from collections.abc import Callable
from typing import Any

import numpy as np

from contracts.images import decode_depth_units
from contracts.scene import Scene
from contracts.vehicle import Observation
from tests.services.sim.running_sim import Simulator, error


def depths(seen: Observation) -> list[Any]:
    return [decode_depth_units(view.depth) for view in seen.views if view.depth is not None]


def test_a_profile_by_name_is_flown_with_and_recorded(sim: Simulator, yard: Scene) -> None:
    assert sim.start(yard).sensors == "perfect:1"
    stereo = sim.start(yard, sensors="d455")
    assert stereo.sensors == "d455:1"
    seen = depths(sim.look(stereo.id))
    assert all(65_535 not in units for units in seen)
    assert any((units == 0).any() for units in seen)


def test_a_profile_that_there_is_not_is_refused_with_those_there_are(sim: Simulator, yard: Scene) -> None:
    status, _, message = error(sim.http.post("/v1/episodes", json=sim.question(yard, sensors="d405")))
    assert status == 422
    assert "there are d435, d455, perfect, tof-10m" in message


def test_the_same_seed_and_look_give_the_same_bytes_and_another_seed_others(sim: Simulator, yard: Scene) -> None:
    first, again, other = (sim.start(yard, sensors="d455", seed=seed).id for seed in (5, 5, 6))
    one, two, three = sim.look(first), sim.look(again), sim.look(other)
    assert one.views == two.views
    assert one.pose == two.pose
    assert one.views != three.views
    assert sim.look(first).views != one.views


def test_every_look_has_a_later_time_stamp_and_perfect_eyes_see_the_same(sim: Simulator, yard: Scene) -> None:
    episode = sim.start(yard)
    one, two = sim.look(episode.id), sim.look(episode.id)
    assert one.time_s is not None
    assert two.time_s is not None
    assert one.time_s < two.time_s
    assert one.views == two.views


def test_frozen_cameras_give_the_same_frame_with_the_same_time_while_the_drone_flies_on(
    sim: Simulator, yard: Scene
) -> None:
    episode = sim.start(yard, faults=[{"kind": "frozen", "first_look": 2, "looks": 2}])
    before = sim.look(episode.id)
    frozen = sim.look(episode.id)
    sim.move(episode.id, 1, [{"x": 0.0, "y": -15.0, "z": 6.0}])
    still = sim.look(episode.id, cameras="front")
    after = sim.look(episode.id)
    assert before.time_s != frozen.time_s == still.time_s != after.time_s
    assert still.views == tuple(view for view in frozen.views if view.camera.name == "front")
    assert still.pose.z == 6.0
    assert after.views != frozen.views


def test_a_blind_look_says_nothing_of_any_depth(sim: Simulator, yard: Scene) -> None:
    episode = sim.start(yard, faults=[{"kind": "no_depth", "first_look": 2, "looks": 1}])
    seeing, blind, again = (depths(sim.look(episode.id)) for _ in range(3))
    assert any(units.any() for units in seeing)
    assert not any(units.any() for units in blind)
    assert all(np.array_equal(a, b) for a, b in zip(seeing, again, strict=True))


def test_a_jump_moves_what_is_believed_and_not_the_drone(sim: Simulator, yard: Scene) -> None:
    episode = sim.start(yard, faults=[{"kind": "pose_jump", "first_look": 2, "jump_m": 3.0}])
    one, two, three = (sim.look(episode.id) for _ in range(3))
    assert two.pose.x == one.pose.x + 3.0 == three.pose.x
    assert one.views == two.views


def test_the_tiny_renderer_has_real_sensors_too(launch: Callable[..., Simulator], yard: Scene) -> None:
    tiny = launch(renderer="tiny")
    seen = depths(tiny.look(tiny.start(yard, sensors="d435").id, cameras="front"))
    assert ((seen[0] > 0) & (seen[0] * 0.002 <= 10.001)).any()
