"""llm_parser over HTTP: answers of the contract, clear errors, health and figures."""

import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any

import httpx
import pytest
from starlette.types import ASGIApp

from service_kit.settings import BadSetting
from services.llm_parser.bootstrap import bootstrap
from services.llm_parser.settings import LlmParserSettings

REQUEST = "Please bring my parcel to the fourth floor, the window with the green flower pot."


@pytest.fixture(scope="module")
def service(serve: Callable[[ASGIApp], str]) -> Iterator[httpx.Client]:
    """The service with its defaults; nobody listens where it looks for the gateway."""
    url = serve(bootstrap(LlmParserSettings.read({"VLM_GATEWAY_URL": "http://127.0.0.1:9"})))
    with httpx.Client(base_url=url, timeout=60) as client:
        yield client


def test_a_request_is_answered_with_floor_object_and_evidence(service: httpx.Client) -> None:
    answer = service.post("/v1/parse", json={"request": REQUEST})
    assert answer.status_code == 200
    told = answer.json()
    assert {k: told[k] for k in ("outcome", "floor", "object", "missing", "question", "language", "model")} == {
        "outcome": "answered",
        "floor": 4,
        "object": "green flower pot",
        "missing": [],
        "question": None,
        "language": "en",
        "model": "reader",
    }
    assert told["evidence"]["floor"] == "fourth"
    assert told["evidence"]["object"].removeprefix("the ") == "green flower pot"
    assert 0.9 < told["confidence"]["floor"] <= 1.0


def test_what_is_not_said_is_null_and_named(service: httpx.Client) -> None:
    answer = service.post("/v1/parse", json={"request": "Where is my order?", "model": "reader"}).json()
    assert (answer["floor"], answer["object"], answer["missing"]) == (None, None, ["floor", "object"])


@pytest.mark.parametrize(
    ("body", "code"),
    [
        ({}, "invalid"),
        ({"request": ""}, "invalid"),
        ({"request": " \n\t "}, "blank_request"),
        ({"request": "x" * 4001}, "invalid"),
        ({"request": 7}, "invalid"),
        ({"request": None}, "invalid"),
        ({"request": [REQUEST]}, "invalid"),
        ({"request": REQUEST, "floor": 4}, "invalid"),
        ({"request": REQUEST, "model": "no spaces allowed"}, "invalid"),
        ([REQUEST], "invalid"),
    ],
)
def test_a_bad_question_is_refused_in_our_shape(service: httpx.Client, body: object, code: str) -> None:
    answer = service.post("/v1/parse", json=body)
    assert answer.status_code == 422
    assert answer.json()["error"]["code"] == code


@pytest.mark.parametrize("body", [b"", b"{", b'{"request": "floor 3 \\ud800"}', b"\xff\xfe"])
def test_what_is_no_json_or_no_text_is_refused(service: httpx.Client, body: bytes) -> None:
    answer = service.post("/v1/parse", content=body, headers={"content-type": "application/json"})
    assert 400 <= answer.status_code < 500
    assert answer.json()["error"]["message"]


def test_a_body_over_the_limit_is_refused_unread(service: httpx.Client) -> None:
    answer = service.post("/v1/parse", content=b"x" * 100_000, headers={"content-type": "application/json"})
    assert (answer.status_code, answer.json()["error"]["code"]) == (413, "body_too_large")


def test_a_gateways_alias_without_a_gateway_is_a_503_and_no_answer(service: httpx.Client) -> None:
    answer = service.post("/v1/parse", json={"request": REQUEST, "model": "r1-distill"})
    assert (answer.status_code, answer.json()["error"]["code"]) == (503, "model_unreachable")


def test_the_reader_is_ready_without_a_gateway_and_say_what_they_are(service: httpx.Client) -> None:
    assert service.get("/healthz").status_code == 200
    ready = service.get("/readyz")
    assert ready.status_code == 200
    assert ready.json()["about"] == {"backend": "reader"}


def test_answers_are_counted_by_back_end_outcome_and_what_was_missing(service: httpx.Client) -> None:
    service.post("/v1/parse", json={"request": "the window with the purple umbrella, please"})
    page = service.get("/metrics").text
    assert 'llm_parser_answers_total{backend="reader",missing="floor",outcome="answered"} 1.0' in page


def test_the_named_model_answers_beside_the_default(serve: Callable[[ASGIApp], str], model_server: Any) -> None:
    url = serve(bootstrap(LlmParserSettings.read({"VLM_GATEWAY_URL": model_server.url})))
    model_server.says('{"floor": 4, "object": "green flower pot"}')
    answer = httpx.post(f"{url}/v1/parse", json={"request": REQUEST, "model": "r1-distill"}, timeout=60).json()
    assert (answer["model"], answer["floor"]) == ("r1-distill", 4)
    assert model_server.asked[0]["model"] == "r1-distill"


def test_an_alias_that_the_gateway_does_not_know_is_a_422(serve: Callable[[ASGIApp], str], model_server: Any) -> None:
    url = serve(bootstrap(LlmParserSettings.read({"VLM_GATEWAY_URL": model_server.url})))
    model_server.fails(404, "model_not_found", "no chat model 'gpt-9'; chat models: none")
    answer = httpx.post(f"{url}/v1/parse", json={"request": REQUEST, "model": "gpt-9"}, timeout=60)
    assert (answer.status_code, answer.json()["error"]["code"]) == (422, "unknown_model")


def test_chat_as_the_default_is_ready_only_with_its_gateway(serve: Callable[[ASGIApp], str], model_server: Any) -> None:
    url = serve(bootstrap(LlmParserSettings.read({"PARSER_BACKEND": "chat", "VLM_GATEWAY_URL": model_server.url})))
    assert httpx.get(f"{url}/readyz", timeout=60).status_code == 200
    model_server.says('{"floor": 4, "object": "green flower pot"}')
    assert httpx.post(f"{url}/v1/parse", json={"request": REQUEST}, timeout=60).json()["model"] == "parser"
    model_server.stop()
    answer = httpx.get(f"{url}/readyz", timeout=60)
    assert (answer.status_code, answer.json()["error"]["code"]) == (503, "not_ready")


def test_a_setting_that_cannot_be_used_is_named() -> None:
    with pytest.raises(BadSetting, match="PARSER_BACKEND=gpt"):
        bootstrap(LlmParserSettings.read({"PARSER_BACKEND": "gpt"}))


def test_the_service_runs_as_a_process_and_stops_when_told() -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    process = subprocess.Popen(
        [sys.executable, "-m", "services.llm_parser"],
        env=os.environ | {"PORT": str(port), "PARSER_BACKEND": "reader"},
        stderr=subprocess.DEVNULL,
    )
    try:
        give_up = time.monotonic() + 30
        while time.monotonic() < give_up:
            try:
                answer = httpx.post(f"http://127.0.0.1:{port}/v1/parse", json={"request": REQUEST}, timeout=60)
                break
            except httpx.TransportError:
                time.sleep(0.05)
        assert answer.json()["floor"] == 4
        process.terminate()
        process.wait(10)
    finally:
        process.kill()
        process.wait()
