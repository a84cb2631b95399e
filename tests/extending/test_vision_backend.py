"""A vision back end from a package outside the tree, in the gateway's own process."""

import json
import os
import subprocess
import sys
from pathlib import Path

import cv2
import httpx
import numpy as np
import pybase64
import pytest

from tests.cameras import camera_json
from tests.load.processes import service
from tests.services.vlm_gateway.kit import find_body, floors_body, post


def view(heading_deg: int, patch: tuple[int, int, int, int] | None) -> dict[str, object]:
    """A grey picture of 400 x 400; `patch` (left, top, right, bottom) is green."""
    bgr = np.full((400, 400, 3), (180, 195, 205), np.uint8)
    if patch is not None:
        left, top, right, bottom = patch
        bgr[top:bottom, left:right] = (40, 200, 40)
    ok, jpeg = cv2.imencode(".jpg", bgr)
    assert ok
    return {
        "camera": camera_json(heading_deg, 400),
        "image": {"jpeg_base64": pybase64.b64encode(jpeg.tobytes()).decode()},
    }


def settings(extras: Path, tmp_path: Path, config: str = "") -> dict[str, str]:
    environment = {"PYTHONPATH": str(extras), "CACHE_PATH": str(tmp_path / "answers.sqlite"), "REDIS_URL": ""}
    if not config:
        return environment | {"GATEWAY_CONFIG": ""}
    (tmp_path / "gateway.toml").write_text(config)
    return environment | {"GATEWAY_CONFIG": str(tmp_path / "gateway.toml")}


def test_an_installed_back_end_answers_under_its_own_name_without_any_configuration(
    extras: Path, tmp_path: Path
) -> None:
    with service("services.vlm_gateway", settings(extras, tmp_path)) as gateway:
        listed = httpx.get(gateway.url + "/v1/models", timeout=60).json()["data"]
        assert [(m["id"], m["owned_by"]) for m in listed] == [("colour", "colour"), ("embedded", "embedded")]
        views = [view(0, None), view(90, (100, 40, 200, 80))]
        body = {"model": "colour", "object": "green flower pot", "views": views}
        answer = post(gateway.url, "/v1/find-object", body).json()
        assert (answer["backend"], answer["model"], answer["found"]) == ("colour", "colour-1", True)
        (match,) = answer["matches"]
        assert match["camera"] == "right"
        assert abs(match["box"]["x_min"] - 0.25) < 0.01
        assert post(gateway.url, "/v1/find-object", body).json()["cache"] == "hit"
        known = post(gateway.url, "/v1/preflight", {"model": "colour", "object": "saxophone"}).json()
        assert (known["known"], known["backend"]) == (False, "colour")
        refused = post(gateway.url, "/v1/find-object", body | {"object": "umbrella"}).json()
        assert (refused["outcome"], refused["found"]) == ("refused", None)


def test_the_configuration_gives_it_options_and_roles(extras: Path, tmp_path: Path) -> None:
    config = '[models.mine]\nbackend = "colour"\noptions = { min_share = 0.5 }\n[roles]\nrecognition = "mine"\n'
    with service("services.vlm_gateway", settings(extras, tmp_path, config)) as gateway:
        body = {"object": "green flower pot", "views": [view(0, (100, 40, 200, 80))]}
        answer = post(gateway.url, "/v1/find-object", body).json()
        assert (answer["backend"], answer["found"]) == ("colour", False)
        assert post(gateway.url, "/v1/floor-count", floors_body()).json()["backend"] == "embedded"


@pytest.mark.slow  # a whole flight, 15 s of a core; tests/logisticsvln/test_roles.py asks what is asked
def test_a_delivery_that_names_no_model_is_flown_by_the_roles_of_the_configuration(
    extras: Path, tmp_path: Path
) -> None:
    config = '[models.mine]\nbackend = "colour"\n[roles]\nrecognition = "mine"\n'
    environment = os.environ | settings(extras, tmp_path, config) | {"CACHE_MODE": "off"}
    options = ["--json", "--image-size", "320", "--max-steps", "2", "--out", str(tmp_path / "runs")]
    deliver = [sys.executable, "-m", "command_line", "deliver", "--sample", "green-flower-pot", *options]
    ended = subprocess.run(deliver, env=environment, capture_output=True, text=True, timeout=280)
    told = json.loads(ended.stdout)
    by = {role: calls["models"] for role, calls in told["model_calls"].items()}
    assert by["recognition"] == ["colour-1"], ended.stderr
    assert by["floors"] == ["embedded-4.1"]
    assert told["backend"] is None


def test_options_that_it_does_not_know_are_told_when_it_is_asked(extras: Path, tmp_path: Path) -> None:
    config = '[models.mine]\nbackend = "colour"\noptions = { shade = 3 }\n'
    with service("services.vlm_gateway", settings(extras, tmp_path, config)) as gateway:
        answer = post(gateway.url, "/v1/find-object", find_body(model="mine"))
        assert answer.status_code == 503
        assert "models.mine.options" in answer.json()["error"]["message"]


def test_a_key_that_it_has_not_is_told_with_those_there_are(extras: Path, tmp_path: Path) -> None:
    environment = os.environ | settings(extras, tmp_path, '[models.mine]\nbackend = "colour"\nmin_share = 0.5\n')
    gateway = [sys.executable, "-m", "services.vlm_gateway"]
    ended = subprocess.run(gateway, env=environment, capture_output=True, text=True, timeout=120)
    assert ended.returncode != 0
    assert "models.mine.min_share: no such key; there are backend, options" in ended.stderr
    assert "Traceback" not in ended.stderr
