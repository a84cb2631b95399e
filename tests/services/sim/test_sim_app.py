"""The simulator over real HTTP, with PyBullet and a renderer, in a street of boxes."""

import json
from collections.abc import Callable

import pytest

from contracts.cameras import pinhole_camera
from contracts.images import decode_depth, decode_jpeg
from contracts.scene import Scene
from contracts.sim import Catalogue, Episode, Truth, Verdict
from contracts.vehicle import MoveResult
from tests.cameras import camera_json
from tests.services.sim.running_sim import BEFORE_THE_POT, CATALOGUE, Simulator, error


def test_a_delivery_from_start_to_verdict(sim: Simulator, yard: Scene) -> None:
    episode = sim.start(yard)
    drone = episode.vehicle
    assert (episode.status, episode.scene, episode.rig) == ("flying", "yard", "paper-five")
    assert (drone.mode, drone.moves, drone.path_m, drone.collided) == ("holding", 0, 0.0, False)
    flown = MoveResult.model_validate_json(sim.move(episode.id, 1, BEFORE_THE_POT).content)
    assert flown.reached
    assert flown.hit is None
    assert flown.path_m == pytest.approx(6.15 + 8.0)
    assert flown.flight_s > 14.15 / 4.0
    assert flown.vehicle.path_horizontal_m == pytest.approx(8.0)
    verdict = Verdict.model_validate_json(sim.http.post(f"/v1/episodes/{episode.id}/claim", json={}).content)
    assert verdict.delivered
    assert verdict.right_window
    assert verdict.distance_m == pytest.approx(2.0)
    assert sim.http.get(f"/v1/episodes/{episode.id}/trial").json()["status"] == "claimed"
    assert sim.http.delete(f"/v1/episodes/{episode.id}").status_code == 204
    assert sim.http.get(f"/v1/episodes/{episode.id}").status_code == 404


def test_the_first_claim_ends_the_episode_and_stays_its_verdict(sim: Simulator, yard: Scene) -> None:
    episode = sim.start(yard)
    claim = f"/v1/episodes/{episode.id}/claim"
    first = sim.http.post(claim, json={})
    assert not first.json()["delivered"]
    better = sim.http.post(claim, json={"target": {"x": 0.0, "y": -5.3, "z": 7.1}})
    assert better.json() == first.json()
    assert error(sim.move(episode.id, 1, BEFORE_THE_POT))[:2] == (409, "episode_claimed")
    assert sim.http.get(f"/v1/episodes/{episode.id}/trial").json()["status"] == "claimed"


def test_a_move_sent_twice_is_flown_once(sim: Simulator, yard: Scene) -> None:
    episode = sim.start(yard)
    first = sim.move(episode.id, 1, BEFORE_THE_POT)
    again = sim.move(episode.id, 1, BEFORE_THE_POT)
    assert again.json() == first.json()
    assert sim.http.get(f"/v1/episodes/{episode.id}").json()["path_m"] == first.json()["path_m"]


@pytest.mark.parametrize("number", [0, 2, 7])
def test_a_gap_in_the_numbers_names_the_expected_one(sim: Simulator, yard: Scene, number: int) -> None:
    episode = sim.start(yard)
    answer = sim.move(episode.id, number, [])
    status, code, message = error(answer)
    assert (status, code) == (409, "move_out_of_order")
    assert "the next move is 1" in message
    assert answer.json()["error"]["details"] == {"expected": 1}


def test_another_move_under_the_last_number_is_refused(sim: Simulator, yard: Scene) -> None:
    episode = sim.start(yard)
    sim.move(episode.id, 1, BEFORE_THE_POT)
    status, code, message = error(sim.move(episode.id, 1, BEFORE_THE_POT[:1]))
    assert (status, code) == (409, "move_differs")
    assert "the next move is 2" in message


def test_a_collision_is_remembered(sim: Simulator, yard: Scene) -> None:
    episode = sim.start(yard)
    hit = sim.move(episode.id, 1, [{"x": 2.5, "y": 0.0, "z": 1.5}]).json()
    assert (hit["reached"], hit["collided"], hit["hit"]) == (False, True, "house")
    assert hit["pose"]["y"] < -5.3
    back = sim.move(episode.id, 2, [{"x": 0.0, "y": -15.0, "z": 1.5}]).json()
    assert (back["reached"], back["collided"], back["hit"]) == (True, False, None)
    assert back["vehicle"]["collided"]
    sim.move(episode.id, 3, BEFORE_THE_POT)
    verdict = sim.http.post(f"/v1/episodes/{episode.id}/claim").json()
    assert (verdict["right_window"], verdict["delivered"], verdict["collided"]) == (True, False, True)


def test_five_views_with_depth_in_one_call(sim: Simulator, yard: Scene) -> None:
    episode = sim.start(yard, size=96)
    seen = sim.look(episode.id)
    assert seen.vehicle == episode.id
    assert [view.camera.name for view in seen.views] == ["left", "front-left", "front", "front-right", "right"]
    assert {(v.camera.width, v.camera.height, v.camera.fx_px) for v in seen.views} == {(96, 96, 48.0)}
    front = seen.views[2]
    assert decode_jpeg(front.image).shape == (96, 96, 3)
    assert front.depth is not None
    # the facade is 10 m ahead of the start, upright to the axis: the same planar depth all along it
    assert decode_depth(front.depth)[40, 30:66] == pytest.approx(10.0, abs=0.02)
    assert sim.look(episode.id).number == 2


def test_any_subset_of_views_in_the_order_asked_for(sim: Simulator, yard: Scene) -> None:
    episode = sim.start(yard)
    seen = sim.look(episode.id, cameras="right, front", depth="false")
    assert [view.camera.name for view in seen.views] == ["right", "front"]
    assert all(view.depth is None for view in seen.views)


def test_the_same_scene_gives_the_same_bytes(sim: Simulator, yard: Scene) -> None:
    first, second = (sim.look(sim.start(yard, size=128).id) for _ in range(2))
    assert first.views == second.views


def test_the_truth_names_the_goal_and_the_remaining_way(sim: Simulator, yard: Scene) -> None:
    episode = sim.start(yard)
    sim.move(episode.id, 1, BEFORE_THE_POT)
    question = {
        "cameras": [camera_json(0, 128), camera_json(90, 128)],
        "candidates": [{"x": 0.0, "y": -10.5, "z": 7.65}],
    }
    answer = sim.http.post(f"/v1/episodes/{episode.id}/truth", json=question)
    truth = Truth.model_validate_json(answer.content)
    assert [o.id for o in truth.views[0].objects] == ["pot"]
    assert truth.views[1].objects == ()
    assert truth.remaining_m == pytest.approx((4.0,))


def test_the_truth_after_a_look_is_that_without_one_and_follows_the_drone(sim: Simulator, yard: Scene) -> None:
    question = {"cameras": [camera_json(0, 128), camera_json(45, 128)]}

    def told(episode: Episode) -> Truth:
        answer = sim.http.post(f"/v1/episodes/{episode.id}/truth", json=question)
        return Truth.model_validate_json(answer.content)

    looked, blind = sim.start(yard, size=128), sim.start(yard)
    sim.look(looked.id, cameras="front,right")
    sim.look(blind.id)
    assert told(looked).views == told(blind).views
    sim.look(looked.id)
    assert told(looked).views == told(blind).views
    for episode in (looked, blind):
        sim.move(episode.id, 1, BEFORE_THE_POT)
    assert told(looked).views == told(blind).views
    assert [o.id for o in told(looked).views[0].objects] == ["pot"]


def test_the_truth_is_told_of_any_camera_whatever_the_rig_is(sim: Simulator, yard: Scene) -> None:
    episode = sim.start(yard)
    sim.move(episode.id, 1, BEFORE_THE_POT)
    wide = pinhole_camera("wide", 192, 108, horizontal_fov_deg=120.0, heading_deg=-30.0)
    question = {
        "cameras": [wide.model_dump(), wide.model_copy(update={"name": "down", "pitch_deg": -80.0}).model_dump()]
    }
    answer = sim.http.post(f"/v1/episodes/{episode.id}/truth", json=question)
    views = Truth.model_validate_json(answer.content).views
    assert [view.camera for view in views] == ["wide", "down"]
    (pot,) = views[0].objects
    # straight ahead of the drone is 30 degrees right of the axis: f tan 30 = a third of the half width from the middle
    assert (pot.box.x_min + pot.box.x_max) / 2 == pytest.approx(0.5 + 0.5 / 3, abs=0.01)
    assert (views[1].objects, views[1].floor_rows) == ((), ())


def test_a_camera_with_more_pixels_than_can_be_drawn_is_refused_by_name(sim: Simulator, yard: Scene) -> None:
    rig = {"name": "huge", "cameras": [camera_json(0, 4000)]}
    document = {"scene": yard.model_dump(mode="json"), "rig": rig}
    status, code, message = error(sim.http.post("/v1/episodes", json=document))
    assert (status, code) == (422, "bad_rig")
    assert "'front' has 4000 x 4000" in message


def test_a_truth_of_ways_alone_needs_no_views(sim: Simulator, yard: Scene) -> None:
    episode = sim.start(yard)
    question = {"candidates": [{"x": 0.0, "y": -10.5, "z": 7.65}]}
    truth = Truth.model_validate_json(sim.http.post(f"/v1/episodes/{episode.id}/truth", json=question).content)
    assert truth.views == ()
    assert truth.remaining_m == pytest.approx((4.0,))


def test_the_truth_is_told_only_where_it_is_switched_on(launch: Callable[..., Simulator], yard: Scene) -> None:
    closed = launch(truth=False)
    episode = closed.start(yard)
    status, code, message = error(closed.http.post(f"/v1/episodes/{episode.id}/truth", json={}))
    assert (status, code) == (404, "truth_off")
    assert "SIM_TRUTH=on" in message
    assert "pot" not in json.dumps(closed.http.get(f"/v1/episodes/{episode.id}").json())


def test_the_catalogue_is_told(sim: Simulator) -> None:
    assert Catalogue.model_validate_json(sim.http.get("/v1/catalogue").content) == CATALOGUE


def test_ready_and_every_answer_say_which_renderer_draws(launch: Callable[..., Simulator], yard: Scene) -> None:
    plain = launch(renderer="tiny")
    ready = plain.http.get("/readyz").json()
    assert ready["about"]["renderer"] == "tiny"
    assert "asked for by the settings" in ready["about"]["renderer_detail"]
    episode = plain.start(yard)
    assert episode.renderer == "tiny"
    assert "asked for by the settings" in episode.renderer_detail
    seen = plain.look(episode.id, cameras="front")
    depth = seen.views[0].depth
    assert depth is not None
    assert decode_depth(depth)[28, 20:44] == pytest.approx(10.0, abs=0.05)


def test_live_episodes_are_counted_in_the_metrics(sim: Simulator, yard: Scene) -> None:
    sim.start(yard)
    assert f"sim_live_episodes {float(sim.episodes.live)}" in sim.http.get("/metrics").text
