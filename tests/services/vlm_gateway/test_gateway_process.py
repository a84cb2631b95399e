"""The gateway as it ships: its own process, no configuration, the embedded model, an SQLite cache."""

import subprocess
import sys
from pathlib import Path

import httpx

from tests.load.processes import service
from tests.services.vlm_gateway.kit import direction_body, find_body, floors_body, post


def test_out_of_the_box_the_embedded_model_answers_all_four_questions(tmp_path: Path) -> None:
    environment = {"CACHE_PATH": str(tmp_path / "new" / "answers.sqlite"), "GATEWAY_CONFIG": "", "REDIS_URL": ""}
    with service("services.vlm_gateway", environment) as gateway:
        for path, body in (
            ("/v1/floor-count", floors_body()),
            ("/v1/building-box", floors_body()),
            ("/v1/find-object", find_body()),
            ("/v1/choose-direction", direction_body()),
        ):
            first, second = (post(gateway.url, path, body).json() for _ in range(2))
            assert (first["backend"], first["outcome"]) == ("embedded", "answered")
            assert (first["cache"], second["cache"]) == ("miss", "hit")
        unknown = post(gateway.url, "/v1/find-object", find_body(object="qwertyuiop")).json()
        assert (unknown["outcome"], unknown["found"]) == ("refused", None)
        assert [m["id"] for m in httpx.get(gateway.url + "/v1/models", timeout=60).json()["data"]] == ["embedded"]
        gateway.process.terminate()
        assert gateway.process.wait(20) in (0, -15)


def test_a_gateway_to_models_only_loads_nothing_that_looks_at_pixels_or_asks_other_services() -> None:
    heavy = "{'numpy', 'cv2', 'onnxruntime', 'aiohttp'}"
    code = f"import sys, services.vlm_gateway.bootstrap; print(sorted({heavy} & sys.modules.keys()))"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    assert loaded.stdout == "[]\n"
