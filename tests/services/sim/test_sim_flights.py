"""Flights on their way, over real HTTP: progress, cancellation, hold, take-off, return, landing; keys of episodes."""

import socket
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

import pytest

from contracts.scene import Scene
from contracts.sim import Episode
from contracts.vehicle import MoveProgress, MoveResult, VehicleCapabilities, VehicleState
from episode_kit.limits import Limits
from services.sim.geometry.scene_mesh import SceneMesh
from tests.services.sim.running_sim import Builder, Simulator, error

AS_WATCHED = {"pace": 0.25}
FAR = [{"x": -40.0, "y": -15.0, "z": 1.5}]
"""40 m at 4 m/s: more than ten seconds of flight, more than two and a half of them on the wall clock."""


def state_of(sim: Simulator, episode: Episode) -> VehicleState:
    return VehicleState.model_validate_json(sim.http.get(f"/v1/episodes/{episode.id}").content)


def progress_of(sim: Simulator, episode: Episode, number: int = 1) -> MoveProgress:
    return MoveProgress.model_validate_json(sim.http.get(f"/v1/episodes/{episode.id}/moves/{number}").content)


def told(sim: Simulator, episode: Episode, command: str, **body: Any) -> VehicleState:
    answer = sim.http.post(f"/v1/episodes/{episode.id}/{command}", json=body or None)
    assert answer.status_code == 200, answer.text
    return VehicleState.model_validate_json(answer.content)


def result_of(flying: "Future[Any]") -> MoveResult:
    return MoveResult.model_validate_json(flying.result(60).content)


def until_under_way(sim: Simulator, episode: Episode) -> MoveProgress:
    give_up = time.monotonic() + 20
    while time.monotonic() < give_up:
        answer = sim.http.get(f"/v1/episodes/{episode.id}/moves/1")
        if answer.status_code == 200 and answer.json()["share"] > 0.1:
            return MoveProgress.model_validate_json(answer.content)
        time.sleep(0.02)
    raise AssertionError("the move never got under way")


@pytest.fixture
def aside() -> Any:
    with ThreadPoolExecutor(2) as threads:
        yield threads


def test_a_drone_is_seen_on_its_way_and_stops_where_its_move_is_cancelled(
    sim: Simulator, yard: Scene, aside: ThreadPoolExecutor
) -> None:
    episode = sim.start(yard, flight=AS_WATCHED)
    flying = aside.submit(sim.move, episode.id, 1, FAR)
    first = until_under_way(sim, episode)
    assert (first.state, first.number) == ("flying", 1)
    assert -40.0 < first.pose.x < 0.0
    on_the_way = state_of(sim, episode)
    assert (on_the_way.mode, on_the_way.moves) == ("moving", 1)
    assert on_the_way.path_m == pytest.approx(-on_the_way.pose.x)
    seen = sim.look(episode.id, cameras="front")
    assert -40.0 < seen.pose.x <= first.pose.x
    stopped = MoveResult.model_validate_json(sim.http.delete(f"/v1/episodes/{episode.id}/moves/1").content)
    assert (stopped.cancelled, stopped.reached, stopped.collided) == (True, False, False)
    assert -40.0 < stopped.pose.x <= seen.pose.x
    assert stopped.vehicle.mode == "holding"
    assert result_of(flying) == stopped
    assert state_of(sim, episode) == stopped.vehicle
    assert MoveResult.model_validate_json(sim.move(episode.id, 1, FAR).content) == stopped
    assert progress_of(sim, episode).state == "cancelled"
    assert 0.0 < progress_of(sim, episode).share < 1.0
    onward = sim.move(episode.id, 2, [{"x": stopped.pose.x, "y": -15.0, "z": 2.5}])
    assert onward.json()["reached"]


def test_a_move_under_way_that_is_sent_again_is_waited_for_and_another_is_refused(
    sim: Simulator, yard: Scene, aside: ThreadPoolExecutor
) -> None:
    episode = sim.start(yard, flight=AS_WATCHED)
    flying = aside.submit(sim.move, episode.id, 1, FAR)
    until_under_way(sim, episode)
    again = aside.submit(sim.move, episode.id, 1, FAR)
    assert error(sim.move(episode.id, 2, []))[:2] == (409, "move_under_way")
    assert error(sim.move(episode.id, 1, []))[:2] == (409, "move_differs")
    status, code, message = error(sim.http.post(f"/v1/episodes/{episode.id}/claim"))
    assert (status, code) == (409, "move_under_way")
    assert "POST .../hold" in message
    assert result_of(flying) == result_of(again)
    assert result_of(flying).reached
    assert progress_of(sim, episode) == MoveProgress(number=1, state="done", pose=result_of(flying).pose, share=1.0)


def test_holding_cancels_the_move_under_way(sim: Simulator, yard: Scene, aside: ThreadPoolExecutor) -> None:
    episode = sim.start(yard, flight=AS_WATCHED)
    flying = aside.submit(sim.move, episode.id, 1, FAR)
    until_under_way(sim, episode)
    held = told(sim, episode, "hold")
    assert held.mode == "holding"
    assert result_of(flying).cancelled
    assert result_of(flying).vehicle == held
    assert told(sim, episode, "hold") == held


def test_a_cancellation_that_overtakes_its_move_still_holds(sim: Simulator, yard: Scene) -> None:
    episode = sim.start(yard)
    early = MoveResult.model_validate_json(sim.http.delete(f"/v1/episodes/{episode.id}/moves/1").content)
    assert (early.cancelled, early.path_m) == (True, 0.0)
    assert MoveResult.model_validate_json(sim.move(episode.id, 1, FAR).content) == early
    assert state_of(sim, episode).path_m == 0.0
    assert sim.move(episode.id, 2, FAR).json()["reached"]


def test_a_move_that_is_over_stays_what_it_was_when_it_is_cancelled(sim: Simulator, yard: Scene) -> None:
    episode = sim.start(yard)
    flown = sim.move(episode.id, 1, FAR).json()
    assert sim.http.delete(f"/v1/episodes/{episode.id}/moves/1").json() == flown
    for method in ("GET", "DELETE"):
        assert error(sim.http.request(method, f"/v1/episodes/{episode.id}/moves/7"))[:2] == (404, "no_such_move")


def test_an_episode_can_be_ended_while_its_drone_flies(sim: Simulator, yard: Scene, aside: ThreadPoolExecutor) -> None:
    episode = sim.start(yard, flight=AS_WATCHED)
    flying = aside.submit(sim.move, episode.id, 1, FAR)
    until_under_way(sim, episode)
    assert sim.http.delete(f"/v1/episodes/{episode.id}").status_code == 204
    assert result_of(flying).cancelled
    assert sim.http.get(f"/v1/episodes/{episode.id}").status_code == 404


def test_it_lands_takes_off_and_returns_over_the_roofs(sim: Simulator, yard: Scene) -> None:
    episode = sim.start(yard)
    assert told(sim, episode, "take-off", height_m=3.0) == episode.vehicle  # it flies already
    behind = [{"x": 0.0, "y": -15.0, "z": 14.0}, {"x": 0.0, "y": 15.0, "z": 14.0}, {"x": 0.0, "y": 15.0, "z": 2.0}]
    assert sim.move(episode.id, 1, behind).json()["reached"]
    landed = told(sim, episode, "land")
    assert (landed.mode, landed.collided) == ("landed", False)
    assert landed.pose.z == pytest.approx(0.35, abs=0.01)
    assert error(sim.move(episode.id, 2, []))[:2] == (409, "landed")
    assert told(sim, episode, "return") == landed
    risen = told(sim, episode, "take-off", height_m=2.0)
    assert (risen.mode, risen.pose.z) == ("holding", pytest.approx(2.35, abs=0.01))
    home = told(sim, episode, "return")
    assert (home.mode, home.collided) == ("holding", False)
    assert (home.pose.x, home.pose.y, home.pose.z) == pytest.approx((0.0, -15.0, 1.5))
    assert home.path_m > risen.path_m + 30.0


def test_the_battery_empties_with_the_time_flown_and_health_tells_what_is_wrong(sim: Simulator, yard: Scene) -> None:
    episode = sim.start(yard, flight={"endurance_s": 10.0})
    assert (episode.vehicle.battery.remaining, episode.vehicle.health.ok) == (1.0, True)
    after = MoveResult.model_validate_json(sim.move(episode.id, 1, [{"x": -6.0, "y": -15.0, "z": 1.5}]).content)
    remaining = after.vehicle.battery.remaining
    assert remaining == pytest.approx(1.0 - after.flight_s / 10.0)
    assert after.vehicle.health.ok
    empty = MoveResult.model_validate_json(sim.move(episode.id, 2, FAR).content).vehicle
    assert (empty.battery.remaining, empty.health.problems) == (0.0, ("its battery is empty",))
    refused = sim.move(episode.id, 3, [{"x": -30.0, "y": -15.0, "z": 1.5}])
    assert (refused.status_code, refused.json()["error"]["code"]) == (409, "battery_empty")
    other = sim.start(yard)
    hit = MoveResult.model_validate_json(sim.move(other.id, 1, [{"x": 0.0, "y": -15.0, "z": -1.0}]).content)
    assert "it has hit ground" in hit.vehicle.health.problems


def test_a_drone_that_drifts_says_how_unsure_it_is(sim: Simulator, yard: Scene) -> None:
    episode = sim.start(yard, flight={"drift": 0.02})
    assert episode.vehicle.uncertainty.horizontal_m == 0.0
    after = MoveResult.model_validate_json(sim.move(episode.id, 1, FAR).content).vehicle
    assert after.uncertainty.horizontal_m == pytest.approx(0.8)
    assert sim.look(episode.id, cameras="front").uncertainty == after.uncertainty


def test_the_capabilities_name_the_rigs_cameras(sim: Simulator, yard: Scene) -> None:
    episode = sim.start(yard, size=96)
    answer = sim.http.get(f"/v1/episodes/{episode.id}/capabilities")
    able = VehicleCapabilities.model_validate_json(answer.content)
    assert able.cameras == tuple(view.camera for view in sim.look(episode.id).views)
    assert (able.kind, able.cancels_moves, able.lands) == ("simulator", True, True)


def test_the_same_key_again_is_the_same_episode(sim: Simulator, yard: Scene) -> None:
    first = sim.start(yard, key="delivery-7")
    sim.move(first.id, 1, FAR)
    again = sim.start(yard, key="delivery-7")
    assert (again.id, again.vehicle.moves) == (first.id, 1)
    other = sim.http.post("/v1/episodes", json=sim.question(yard, 96, key="delivery-7"))
    assert error(other)[:2] == (409, "key_differs")
    assert sim.start(yard, key="delivery-8").id != first.id
    sim.http.delete(f"/v1/episodes/{first.id}")
    assert sim.start(yard, key="delivery-7").id != first.id


def test_a_refused_question_leaves_its_key_free(sim: Simulator, yard: Scene) -> None:
    bad = sim.question(yard, key="retried")
    bad["scene"]["objects"][0]["kind"] = "unicorn"
    assert sim.http.post("/v1/episodes", json=bad).status_code == 422
    assert sim.start(yard, key="retried").status == "flying"


def test_an_episode_is_freed_by_its_key_also_while_it_is_being_begun(
    launch: Callable[..., Simulator], box_builder: Builder, yard: Scene, aside: ThreadPoolExecutor
) -> None:
    slow = SlowBuilder(box_builder)
    sim = launch(builder=slow)
    waiting = aside.submit(sim.http.post, "/v1/episodes", json=sim.question(yard, key="mine"))
    assert slow.begun.wait(60)
    freed = aside.submit(sim.http.delete, "/v1/episodes", params={"key": "mine"})
    slow.go_on.set()
    assert freed.result(60).status_code == 204
    waiting.result(60)
    assert sim.episodes.live == 0
    assert sim.http.delete("/v1/episodes", params={"key": "unknown"}).status_code == 204


def test_an_episode_whose_caller_left_before_it_was_there_is_not_kept(
    launch: Callable[..., Simulator], box_builder: Builder, yard: Scene
) -> None:
    slow = SlowBuilder(box_builder)
    sim = launch(Limits(max_episodes=1), builder=slow)
    hang_up(sim, sim.question(yard, key="left"), slow)
    until_there_is_room(sim, yard)


def until_there_is_room(sim: Simulator, scene: Scene) -> None:
    """Returns once the one place for an episode is free, and takes it."""
    give_up = time.monotonic() + 60
    while sim.http.post("/v1/episodes", json=sim.question(scene)).status_code != 201:
        assert time.monotonic() < give_up, "an episode is kept for nobody"
        time.sleep(0.05)


class SlowBuilder:
    """Builds when told to."""

    def __init__(self, builder: Builder) -> None:
        self._builder = builder
        self.begun, self.go_on = threading.Event(), threading.Event()

    def __call__(self, scene: Scene) -> SceneMesh:
        self.begun.set()
        assert self.go_on.wait(120)
        return self._builder(scene)


def hang_up(sim: Simulator, question: dict[str, Any], slow: SlowBuilder) -> None:
    """Asks for an episode and closes the connection while its scene is being built."""
    request = sim.http.build_request("POST", "/v1/episodes", json=question)
    host, port = sim.url.removeprefix("http://").split(":")
    with socket.create_connection((host, int(port))) as line:
        lines = [f"POST /v1/episodes HTTP/1.1\r\nHost: {host}\r\nContent-Type: application/json\r\n"]
        lines.append(f"Content-Length: {len(request.content)}\r\n\r\n")
        line.sendall("".join(lines).encode() + request.content)
        assert slow.begun.wait(60)
    time.sleep(0.1)  # the closing reaches the server before the scene is there
    slow.go_on.set()
