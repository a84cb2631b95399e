"""A typed question from a package outside the tree, in the gateway's own process, before a chat model's server."""

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from tests.extending.conftest import install
from tests.load.processes import Running, free_port, service
from tests.services.vlm_gateway.kit import floors_body, post
from tests.services.vlm_gateway.openai_mock import OpenAiMock, says

CONFIG = """
[models.chatty]
backend = "chat"
preset = "gpt-4o"
server = "openai-compatible"
base_url = "{url}/v1"
model = "m"
"""


@pytest.fixture(scope="module")
def model() -> Iterator[OpenAiMock]:
    mock = OpenAiMock().start()
    yield mock
    mock.stop()


@pytest.fixture(scope="module")
def gateway(extras: Path, model: OpenAiMock, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    folder = tmp_path_factory.mktemp("gateway")
    (folder / "gateway.toml").write_text(CONFIG.format(url=model.url.removesuffix("/v1")))
    settings = {
        "PYTHONPATH": str(extras),
        "GATEWAY_CONFIG": str(folder / "gateway.toml"),
        "CACHE_PATH": str(folder / "answers.sqlite"),
        "REDIS_URL": "",
    }
    with service("services.vlm_gateway", settings) as running:
        yield running


def test_a_chat_model_answers_an_installed_question_and_the_answer_is_kept(gateway: Running, model: OpenAiMock) -> None:
    model.will(says('{"balconies": 4}'))
    first, second = (post(gateway.url, "/v1/balcony-count", floors_body(model="chatty")).json() for _ in range(2))
    assert (first["outcome"], first["balconies"], first["cache"]) == ("answered", 4, "miss")
    assert (second["balconies"], second["cache"]) == (4, "hit")


def test_an_answer_that_says_nothing_is_told_from_one_that_cannot_be_read(gateway: Running, model: OpenAiMock) -> None:
    model.will(says('{"balconies": null}'))
    asked = floors_body(shade=90, model="chatty")
    refused = post(gateway.url, "/v1/balcony-count", asked).json()
    assert (refused["outcome"], refused["balconies"]) == ("refused", None)
    model.will(says('{"balconies": "several"}'))
    unreadable = post(gateway.url, "/v1/balcony-count", asked).json()
    assert (unreadable["outcome"], unreadable["balconies"]) == ("unreadable", None)


def test_a_back_end_that_does_not_know_the_question_says_so(gateway: Running) -> None:
    answer = post(gateway.url, "/v1/balcony-count", floors_body(model="embedded"))
    assert (answer.status_code, answer.json()["error"]["code"]) == (422, "cannot_answer")


def test_the_api_describes_it(gateway: Running) -> None:
    described = httpx.get(gateway.url + "/openapi.json", timeout=60).json()["paths"]["/v1/balcony-count"]["post"]
    assert described["description"] == "How many balconies are visible in the picture?"
    assert described["requestBody"]["content"]["application/json"]["schema"]["$ref"].endswith("BalconyCountQuestion")


def test_one_that_takes_a_built_in_route_ends_the_gateway_with_a_sentence(tmp_path: Path) -> None:
    package = tmp_path / "source"
    (package / "route_taker").mkdir(parents=True)
    (package / "route_taker" / "__init__.py").write_text("QUESTION = None\n")
    (package / "pyproject.toml").write_text(
        '[project]\nname = "route-taker"\nversion = "1"\n'
        '[project.entry-points."logisticsvln.typed_questions"]\nfloor-count = "route_taker:QUESTION"\n'
    )
    site = install(package, tmp_path / "site")
    process = subprocess.run(
        [sys.executable, "-m", "services.vlm_gateway"],
        env=os.environ | {"PYTHONPATH": str(site), "PORT": str(free_port()), "GATEWAY_CONFIG": "", "CACHE_MODE": "off"},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert process.returncode == 1
    assert "route-taker" in process.stderr
    assert "'floor-count', which is built in" in process.stderr
    assert "Traceback" not in process.stderr
