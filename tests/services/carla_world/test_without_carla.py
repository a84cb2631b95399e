"""The service where no CARLA answers: it says so, and refuses what could never be flown before it asks CARLA."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from contracts.cameras import default_rig
from contracts.scene import Scene
from service_kit.settings import BadSetting
from services.carla_world.bootstrap import bootstrap, server_of
from services.carla_world.settings import CarlaWorldSettings
from tests.conftest import Serve, free_port
from tests.services.sim.conftest import make_yard

Ask = Callable[..., httpx.Response]


@pytest.fixture
def http(serve: Serve, tmp_path: Path) -> Iterator[httpx.Client]:
    (tmp_path / "yard.toml").write_text('map = "yard"\n')
    settings = CarlaWorldSettings(carla=f"127.0.0.1:{free_port()}", carla_scenes=tmp_path, carla_timeout_s=0.5)
    with httpx.Client(base_url=serve(bootstrap(settings)), timeout=60.0) as client:
        yield client


@pytest.fixture
def ask(http: httpx.Client) -> Ask:
    def go(scene: Scene | None = None, **more: Any) -> httpx.Response:
        chosen = (scene or make_yard()).model_dump(mode="json")
        return http.post("/v1/episodes", json={"scene": chosen, **more})

    return go


def test_it_is_alive_and_not_ready(http: httpx.Client) -> None:
    assert http.get("/healthz").status_code == 200
    answer = http.get("/readyz")
    assert answer.status_code == 503
    assert "carla" in answer.json()["error"]["details"]["checks"]


def test_an_episode_is_unavailable_and_nothing_of_it_is_kept(ask: Ask) -> None:
    for _ in range(2):  # the second would be one too many if the first were kept
        answer = ask(key="again")
        assert answer.status_code == 503, answer.text
        assert answer.json()["error"]["code"] in {"carla", "carla_missing"}


@pytest.mark.parametrize(
    ("more", "code"),
    [
        ({"flight": {"model": "quadrotor"}}, "not_in_carla"),
        ({"faults": [{"kind": "no_depth"}]}, "not_in_carla"),
        ({"sensors": "d455"}, "not_in_carla"),
        ({"lease_s": 80_000.0}, "lease_too_long"),
    ],
)
def test_what_only_the_simulator_does_is_refused(ask: Ask, more: dict[str, Any], code: str) -> None:
    answer = ask(**more)
    assert (answer.status_code, answer.json()["error"]["code"]) == (422, code)


def test_a_camera_that_carla_has_not_is_refused_by_name(ask: Ask) -> None:
    rig = default_rig().scaled_to(64).model_dump(mode="json")
    rig["cameras"][1]["cx_px"] += 3.0
    answer = ask(rig=rig)
    assert (answer.status_code, answer.json()["error"]["code"]) == (422, "bad_camera")
    assert rig["cameras"][1]["name"] in answer.text


def test_a_scene_that_lies_nowhere_in_carla_is_refused(ask: Ask) -> None:
    answer = ask(make_yard(name="elsewhere"))
    assert (answer.status_code, answer.json()["error"]["code"]) == (422, "no_carla_scene")


def test_an_unknown_episode_is_not_found(http: httpx.Client) -> None:
    for path in ("", "/capabilities", "/observation", "/trial"):
        assert http.get(f"/v1/episodes/none{path}").status_code == 404


@pytest.mark.parametrize("address", ["localhost", "127.0.0.1:", ":2000", "127.0.0.1:0", "127.0.0.1:65535"])
def test_an_address_that_is_none_ends_the_start(address: str) -> None:
    with pytest.raises(BadSetting, match="host:port"):
        server_of(CarlaWorldSettings(carla=address))
