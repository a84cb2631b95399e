"""Clients that people use, unchanged, through the gateway, in environments of their own: `make test-clients`."""

import base64
import json
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from services.vlm_gateway.config import KeyConfig
from services.vlm_gateway.keys import Keys, new_key
from tests.clients.model_server import answers
from tests.conftest import Serve
from tests.services.vlm_gateway.kit import build, chat_backend, wait_until
from tests.services.vlm_gateway.openai_mock import OpenAiMock

pytestmark = pytest.mark.clients
HERE = Path(__file__).parent
CACHE = HERE.parent.parent / ".cache"
MODEL = "maker/model"
JPEG = cv2.imencode(".jpg", np.full((60, 80, 3), 128, np.uint8))[1].tobytes()
READING = {"floor": 4, "object": "green flower pot"}
EXPECTED: dict[str, Any] = {
    "chat": "hello over there",
    "picture": f"a picture of {len(JPEG)} bytes",
    "stream": "hello over there",
    "tools": "the product is 42",
    "structured": READING,
    "as_json": READING,
    "of_a_picture": READING,
    "usage": 5,
    "models": [MODEL],
    "model": MODEL,
    "missing": "model_not_found",
    "begun": 3,
}
PYTHON = {"openai": 10, "litellm": 6, "langchain-openai": 6, "instructor": 3, "pydantic-ai": 6, "anthropic": 8}
NODE = {"openai": 8, "ai": 6}


@pytest.fixture(scope="module")
def model_server() -> Iterator[OpenAiMock]:
    mock = OpenAiMock().start()
    mock.will(answers())
    yield mock
    mock.stop()


def run(command: list[str], serve: Serve, model_server: OpenAiMock) -> dict[str, Any]:
    """What the client says that it got. Its streams that were left are left at the model's server, too."""
    made = new_key()
    backend = chat_backend(model_server, alias=MODEL, server="openai-compatible", preset="generic-vision")
    keys = Keys({"robot": KeyConfig(sha256=made.sha256, models=(MODEL,))})
    url = serve(build({MODEL: backend}, keys=keys).app)
    picture = "data:image/jpeg;base64," + base64.b64encode(JPEG).decode()
    done = subprocess.run(
        [*command, url + "/v1", made.key, picture], capture_output=True, text=True, timeout=170, cwd=HERE
    )
    assert done.returncode == 0, done.stderr[-3000:]
    wait_until(lambda: backend.upstream.admission.running == 0)
    found: dict[str, Any] = json.loads(done.stdout.rpartition("RESULT ")[2])
    return found


def told(found: dict[str, Any]) -> dict[str, Any]:
    return {name: value.strip() if isinstance(value, str) else value for name, value in found.items()}


@pytest.mark.parametrize("client", PYTHON)
def test_a_python_client_works_unchanged(serve: Serve, model_server: OpenAiMock, client: str) -> None:
    found = run([str(CACHE / "clients/bin/python"), str(HERE / "python_clients.py"), client], serve, model_server)
    assert told(found) == {name: EXPECTED[name] for name in found}
    assert len(found) == PYTHON[client]


@pytest.mark.parametrize("client", NODE)
def test_an_npm_client_works_unchanged(serve: Serve, model_server: OpenAiMock, client: str) -> None:
    script = CACHE / "clients-node" / "node_clients.mjs"  # modules are looked for beside the script
    shutil.copy(HERE / script.name, script)
    found = run(["node", str(script), client], serve, model_server)
    assert told(found) == {name: EXPECTED[name] for name in found}
    assert len(found) == NODE[client]
