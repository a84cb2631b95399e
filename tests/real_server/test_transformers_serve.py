"""The gateway in front of `transformers serve` with a tiny random Qwen2-VL: everything it says is noise, and every
question ends in a typed outcome."""

import json
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import pytest
from openai import OpenAI

from tests.conftest import free_port
from tests.real_server.conftest import Gateway, Running, process, transformers_serve
from tests.services.vlm_gateway.kit import direction_body, find_body, floors_body, picture_base64

pytestmark = pytest.mark.real_server

QUESTIONS: dict[str, tuple[Callable[..., dict[str, Any]], str]] = {
    "floor-count": (floors_body, "floors"),
    "building-box": (floors_body, "box"),
    "find-object": (find_body, "found"),
    "choose-direction": (direction_body, "label"),
}
OUTCOMES = {"answered", "unreadable", "refused"}


def config(real: Running, **changes: object) -> str:
    values: dict[str, object] = {
        "backend": "chat",
        "preset": "qwen2-vl",
        "server": "transformers",
        "base_url": real.url,
        "model": real.model,
        "max_tokens": 24,
        "max_pixels": 50_176,
        "timeout_s": 120,
        "concurrency": 1,
    }
    lines = [f"{name} = {json.dumps(value)}" for name, value in (values | changes).items()]
    return "[models.tiny]\n" + "\n".join(lines) + '\n[roles]\nparser = "tiny"\nfloors = "tiny"\n'


def ask(url: str, path: str, body: dict[str, Any], **headers: str) -> httpx.Response:
    return httpx.post(f"{url}/v1/{path}", json={"model": "tiny", **body}, timeout=180, headers=headers)


def chat(text: str, picture: str | None = None) -> list[Any]:
    parts: list[dict[str, Any]] = [{"type": "text", "text": text}]
    if picture:
        parts.append({"type": "image_url", "image_url": {"url": "data:image/jpeg;base64," + picture}})
    return [{"role": "user", "content": parts if picture else text}]


def test_the_openai_client_talks_to_the_model_through_the_gateway(real: Running, gateway: Gateway) -> None:
    url = gateway(config(real))
    client = OpenAI(base_url=url + "/v1", api_key="unused", max_retries=0, timeout=180)
    assert "tiny" in [model.id for model in client.models.list()]
    for messages in (chat("Hello"), chat("What is it?", picture_base64(300, 200))):
        whole = client.chat.completions.create(model="tiny", messages=messages, max_tokens=16, temperature=0)
        direct = httpx.post(
            real.url + "/chat/completions",
            json={"model": real.model, "messages": messages, "max_tokens": 16, "temperature": 0},
            timeout=180,
        ).json()
        assert whole.choices[0].message.content == direct["choices"][0]["message"]["content"] != ""
        assert whole.usage is not None
        assert whole.usage.prompt_tokens == direct["usage"]["prompt_tokens"]
        stream = client.chat.completions.create(
            model="tiny", messages=messages, max_tokens=16, temperature=0, stream=True
        )
        pieces = [piece.choices[0].delta.content or "" for piece in stream if piece.choices]
        # the server cuts a stream at the end of each character's bytes, so noise may be told in other pieces
        content = whole.choices[0].message.content or ""
        assert "".join(pieces).replace("�", "").strip()[:3] == content.replace("�", "")[:3]


@pytest.mark.parametrize("path", QUESTIONS)
def test_every_typed_question_ends_in_a_typed_outcome(real: Running, gateway: Gateway, path: str) -> None:
    body, content = QUESTIONS[path]
    told = ask(gateway(config(real)), path, body()).json()
    assert told["outcome"] in OUTCOMES
    assert (told[content] is None) == (told["outcome"] != "answered" or path == "building-box")
    assert told["tokens"]["prompt"] > 20
    assert told["attempts"] == (2 if told["outcome"] == "unreadable" else 1)
    assert told["text"]


@pytest.mark.parametrize("structured", ["json_schema", "json_object", "guided_json", "grammar"])
def test_what_the_server_does_not_do_about_structure_changes_nothing(
    real: Running, gateway: Gateway, structured: str
) -> None:
    """It ignores response_format, and refuses the fields of others."""
    url = gateway(config(real, structured=structured))
    told = ask(url, "floor-count", floors_body()).json()
    assert told["outcome"] in OUTCOMES
    state = httpx.get(url + "/v1/status").json()["models"]["tiny"]["structured"]
    assert state == (structured if structured.startswith("json_") else "none")


def test_a_request_is_parsed_or_said_to_be_unreadable(real: Running, gateway: Gateway, tmp_path: Path) -> None:
    url = gateway(config(real, preset="deepseek-r1-distill"))
    port = free_port()
    settings = {"PORT": str(port), "PARSER_BACKEND": "chat", "VLM_GATEWAY_URL": url, "PARSER_MAX_TOKENS": "64"}
    command = [sys.executable, "-m", "services.llm_parser"]
    at = f"http://127.0.0.1:{port}"
    with process(command, at + "/healthz", tmp_path / "parser.log", **settings):
        answer = httpx.post(at + "/v1/parse", json={"request": "the fourth floor, the red umbrella"}, timeout=180)
    told = answer.json()
    assert answer.status_code == 200
    assert (told["outcome"], told["floor"], told["object"]) == ("unreadable", None, None)


def test_a_model_the_server_does_not_have_is_rejected(real: Running, gateway: Gateway) -> None:
    answer = ask(gateway(config(real, model="Qwen/another")), "floor-count", floors_body())
    assert (answer.status_code, answer.json()["error"]["code"]) == (502, "model_rejected")
    assert "pinned" in answer.json()["error"]["details"]["upstream_message"]


def test_the_doctor_says_that_this_model_gives_no_boxes(real: Running, gateway: Gateway) -> None:
    url = gateway(config(real))
    command = [sys.executable, "-m", "command_line", "doctor", "--calibrate", "tiny", "--gateway", url]
    done = subprocess.run([*command, "--rounds", "1", "--json"], capture_output=True, text=True, timeout=600)
    told = json.loads(done.stdout)
    assert (done.returncode, told["certainty"], told["shapes_told"]) == (1, "none", 0)


def test_a_server_that_stops_or_dies_is_a_timeout_or_unreachable(
    vision_model: Path, gateway: Gateway, tmp_path: Path
) -> None:
    with transformers_serve(vision_model, tmp_path / "own.log") as own:
        url = gateway(config(own, timeout_s=20))
        assert ask(url, "floor-count", floors_body()).json()["outcome"] in OUTCOMES
        own.process.send_signal(signal.SIGSTOP)
        answer = ask(url, "floor-count", floors_body(), **{"x-timeout-s": "3"})
        assert (answer.status_code, answer.json()["error"]["code"]) == (504, "model_timeout")
        own.process.send_signal(signal.SIGCONT)
        told: list[httpx.Response] = []
        asking = threading.Thread(target=lambda: told.append(ask(url, "find-object", find_body())))
        asking.start()
        time.sleep(0.3)
        own.process.kill()
        own.process.wait()
        asking.join(60)
        assert (told[0].status_code, told[0].json()["error"]["code"]) == (503, "model_unreachable")
        answer = ask(url, "floor-count", floors_body())
        assert (answer.status_code, answer.json()["error"]["code"]) == (503, "model_unreachable")
