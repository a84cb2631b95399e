"""CARLA's server as it should not be: of another release, late, silent, gone, and left behind by somebody else."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from tests.carla.conftest import Launch
from tests.carla.doubles import DoubleProcess
from tests.carla.test_carla_world import begun, fly, look
from tests.services.sim.conftest import make_yard
from tests.services.sim.running_sim import error

pytestmark = pytest.mark.carla


@pytest.fixture
def own_double(tmp_path: Path) -> Iterator[DoubleProcess]:
    with DoubleProcess(tmp_path / "log", "--yard") as running:
        yield running


def asked(http: httpx.Client) -> httpx.Response:
    return http.post("/v1/episodes", json={"scene": make_yard().model_dump(mode="json")})


def world_of(double: DoubleProcess) -> Any:
    """CARLA's own client in that world."""
    import carla

    client = carla.Client("127.0.0.1", double.port)
    client.set_timeout(20.0)
    return client.get_world()


def ours(world: Any) -> int:
    world.tick(20.0)  # before the first a client knows of no actor
    return sum(actor.attributes.get("role_name") == "logisticsvln" for actor in world.get_actors())


def test_another_release_is_refused_before_anything_is_asked_of_it(tmp_path: Path, launch: Launch) -> None:
    with DoubleProcess(tmp_path / "log", "--yard", "--release", "0.9.15") as older:
        http = launch(older.port)
        assert error(asked(http))[:2] == (503, "carla_release")
        assert "0.9.15" in http.get("/readyz").text


def test_pictures_that_are_a_tick_late_are_waited_for_and_later_ones_are_an_error(
    tmp_path: Path, launch: Launch
) -> None:
    with DoubleProcess(tmp_path / "a", "--yard", "--late", "1") as late:
        http = launch(late.port)
        episode = begun(http)
        before = look(http, episode, cameras="front").views[0].image
        fly(http, episode, 1, [{"x": -6.0, "y": -15.0, "z": 4.0}])
        assert look(http, episode, cameras="front").views[0].image != before
    with DoubleProcess(tmp_path / "b", "--yard", "--late", "9") as later:
        assert error(asked(launch(later.port)))[:2] == (503, "late_pictures")


def test_cameras_that_send_no_picture_are_taken_away_again(tmp_path: Path, launch: Launch) -> None:
    with DoubleProcess(tmp_path / "log", "--yard", "--blind") as blind:
        assert error(asked(launch(blind.port, timeout_s=2.0)))[:2] == (503, "no_picture")
        assert ours(world_of(blind)) == 0


def test_a_server_that_falls_silent_is_unavailable_and_may_come_back(own_double: DoubleProcess, launch: Launch) -> None:
    http = launch(own_double.port, timeout_s=8.0)
    episode = begun(http)
    own_double.pause()
    answer = http.get(f"/v1/episodes/{episode.id}/observation")
    assert error(answer)[:2] == (503, "carla")
    assert http.get(f"/v1/episodes/{episode.id}").status_code == 200  # what needs no CARLA is told
    own_double.go_on()
    http.delete(f"/v1/episodes/{episode.id}")
    again = begun(http)
    assert look(http, again, cameras="front").number == 1


def test_a_server_that_was_killed_is_flown_in_again_once_it_is_back(own_double: DoubleProcess, launch: Launch) -> None:
    http = launch(own_double.port, timeout_s=8.0)
    episode = begun(http)
    own_double.kill()
    moved = http.put(f"/v1/episodes/{episode.id}/moves/1", json={"path": [{"x": 0.0, "y": -15.0, "z": 4.0}]})
    assert error(moved)[0] == 503
    assert http.get(f"/v1/episodes/{episode.id}").json()["moves"] == 0  # that number was not used up
    assert http.get("/readyz").status_code == 503
    own_double.start()
    http.delete(f"/v1/episodes/{episode.id}")
    assert look(http, begun(http), cameras="front").number == 1


def test_what_a_killed_service_left_behind_is_taken_away(own_double: DoubleProcess, launch: Launch) -> None:
    left = launch(own_double.port)
    begun(left)  # and nobody ends it
    world = world_of(own_double)
    before = ours(world)
    assert before > 0
    next_one = launch(own_double.port)
    episode = begun(next_one)
    world = world_of(own_double)
    assert ours(world) == before
    next_one.delete(f"/v1/episodes/{episode.id}")
    assert ours(world) == 0


def test_the_world_is_synchronous_while_it_is_flown_in(double: DoubleProcess, http: httpx.Client) -> None:
    episode = begun(http)
    settings = world_of(double).get_settings()
    assert (settings.synchronous_mode, settings.fixed_delta_seconds) == (True, 0.05)
    http.delete(f"/v1/episodes/{episode.id}")
