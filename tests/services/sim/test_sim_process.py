"""`python -m services.sim` with the real scene builder and catalogue."""

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator

import httpx
import numpy as np
import pytest

from contracts.cameras import default_rig
from contracts.images import decode_depth, decode_jpeg
from contracts.scene import Scene
from contracts.sim import Catalogue, Episode, Truth
from contracts.vehicle import Observation
from tests.cameras import camera_json
from tests.ending import WITH_THE_TESTS


def spawn(**settings: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [*WITH_THE_TESTS, sys.executable, "-m", "services.sim"],
        env=os.environ | settings,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.fixture(scope="module")
def process() -> Iterator[tuple[subprocess.Popen[str], str]]:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    running = spawn(PORT=str(port), SIM_TRUTH="on", SIM_MAX_EPISODES="3")
    url = f"http://127.0.0.1:{port}"
    give_up = time.monotonic() + 60
    while True:
        try:
            if httpx.get(f"{url}/readyz", timeout=5).status_code == 200:
                break
        except httpx.TransportError:
            assert running.poll() is None, running.communicate()[1]
            assert time.monotonic() < give_up
            time.sleep(0.05)
    yield running, url
    if running.poll() is None:
        running.kill()
    running.communicate()


def catalogued(yard_with: Callable[..., Scene]) -> Scene:
    """The yard with its pot made of what the real catalogue has."""
    scene = yard_with()
    pot = scene.objects[0].model_copy(update={"kind": "flower_pot", "colour": "green"})
    return yard_with(objects=(pot,))


def test_a_real_scene_is_seen_flown_in_and_told(
    process: tuple[subprocess.Popen[str], str], yard_with: Callable[..., Scene]
) -> None:
    with httpx.Client(base_url=process[1], timeout=60.0) as http:
        kinds = {e.kind for e in Catalogue.model_validate_json(http.get("/v1/catalogue").content).entries}
        assert "flower_pot" in kinds
        rig = default_rig().scaled_to(160).model_dump(mode="json")
        document = {"scene": catalogued(yard_with).model_dump(mode="json"), "rig": rig}
        episode = Episode.model_validate_json(http.post("/v1/episodes", json=document).content)
        path = [{"x": 0.0, "y": -15.0, "z": 7.4}, {"x": 0.0, "y": -8.0, "z": 7.4}]
        assert http.put(f"/v1/episodes/{episode.id}/moves/1", json={"path": path}).json()["reached"]
        seen = http.get(f"/v1/episodes/{episode.id}/observation", params={"cameras": "front"})
        view = Observation.model_validate_json(seen.content).views[0]
        assert view.depth is not None
        depth_m = decode_depth(view.depth)
        assert np.nanmedian(depth_m) == pytest.approx(3.0, abs=0.5)
        told = http.post(f"/v1/episodes/{episode.id}/truth", json={"cameras": [camera_json(0, 160)]})
        (pot,) = (o for o in Truth.model_validate_json(told.content).views[0].objects if o.goal)
        column = int((pot.box.x_min + pot.box.x_max) / 2 * 160)
        row = int((pot.box.y_min + pot.box.y_max) / 2 * 160)
        r, g, b = decode_jpeg(view.image)[row, column].astype(int)
        assert g > r
        assert g > b
        assert depth_m[row, column] < 3.0
        towards = {"path": [{"x": 0.0, "y": 0.0, "z": 7.4}]}
        assert http.put(f"/v1/episodes/{episode.id}/moves/2", json=towards).json()["hit"] in {"pot", "house"}


def test_a_real_scene_with_an_unknown_class_is_refused(
    process: tuple[subprocess.Popen[str], str], yard_with: Callable[..., Scene]
) -> None:
    scene = yard_with().model_dump(mode="json")
    scene["objects"][0]["kind"] = "unicorn"
    answer = httpx.post(f"{process[1]}/v1/episodes", json={"scene": scene}, timeout=60.0)
    assert answer.status_code == 422
    assert answer.json()["error"]["code"] == "unknown_object"
    assert "flower_pot" in answer.json()["error"]["message"]


def test_it_stops_cleanly_when_asked_to(process: tuple[subprocess.Popen[str], str]) -> None:
    running, _ = process
    running.send_signal(signal.SIGTERM)
    _, log = running.communicate(timeout=30)
    assert "Traceback" not in log
    assert running.returncode in (0, -signal.SIGTERM)


@pytest.mark.parametrize(
    ("setting", "value", "said"),
    [("SIM_RENDERER", "vulkan", "auto, moderngl, tiny"), ("SIM_MAX_EPISODES", "many", "from 1 to 500")],
)
def test_a_setting_that_cannot_be_ends_it_with_a_sentence(setting: str, value: str, said: str) -> None:
    running = spawn(**{setting: value})
    _, log = running.communicate(timeout=60)
    assert running.returncode == 1
    assert "Traceback" not in log
    assert f"sim can't start: {setting}={value}" in log
    assert said in log
