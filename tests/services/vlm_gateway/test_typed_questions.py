"""The four typed questions over real HTTP: outcomes, cache, replay, bad input, figures."""

import base64
import concurrent.futures
import socket
import sqlite3
import struct
import zlib
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from contracts.images import encode_jpeg
from services.vlm_gateway.backends.base import Backend
from services.vlm_gateway.backends.embedded import EmbeddedBackend
from services.vlm_gateway.backends.scripted import Script, ScriptedBackend
from services.vlm_gateway.embedded.model import EmbeddedModel
from services.vlm_gateway.usage.accounts import Price
from tests.cameras import camera_json
from tests.conftest import Serve
from tests.services.vlm_gateway.kit import (
    build,
    chat_backend,
    direction_body,
    find_body,
    floors_body,
    metric,
    post,
    rows,
    sqlite_cache,
    wait_until,
)
from tests.services.vlm_gateway.openai_mock import OpenAiMock, says, status
from tests.services.vlm_gateway.tiny_networks import write_networks


def scripted(**lines: Any) -> ScriptedBackend:
    return ScriptedBackend(Script.model_validate({name.replace("_", "-"): value for name, value in lines.items()}))


def test_each_question_brings_its_answer(serve: Serve) -> None:
    box = {"x_min": 0.1, "y_min": 0.2, "x_max": 0.6, "y_max": 0.9}
    match = {"camera": "front-right", "box": box, "confidence": 0.7}
    backend = scripted(
        floor_count=[{"floors": 3, "rows": [0.1, 0.5, 0.9]}],
        building_box=[{"box": box}, {"box": None}],
        find_object=[{"matches": [match]}, {"matches": []}],
        choose_direction=[{"label": "d", "text": "because"}],
    )
    url = serve(build({"s": backend}).app)
    answer = post(url, "/v1/floor-count", floors_body()).json()
    assert (answer["floors"], answer["rows"], answer["outcome"], answer["role"]) == (
        3,
        [0.1, 0.5, 0.9],
        "answered",
        "floors",
    )
    assert (answer["backend"], answer["model"], answer["cache"]) == ("scripted", "scripted", "off")
    assert post(url, "/v1/building-box", floors_body()).json()["box"] == box
    assert post(url, "/v1/building-box", floors_body()).json()["box"] is None
    found = post(url, "/v1/find-object", find_body()).json()
    assert (found["found"], found["matches"], found["role"]) == (True, [match], "recognition")
    assert post(url, "/v1/find-object", find_body()).json()["found"] is False
    chosen = post(url, "/v1/choose-direction", direction_body()).json()
    assert (chosen["label"], chosen["text"], chosen["role"]) == ("d", "because", "choice")


def test_no_unreadable_refused_and_unreachable_are_four_things(serve: Serve) -> None:
    lines = [{"outcome": "answered"}, {"outcome": "unreadable", "text": "hm"}, {"outcome": "refused"}]
    lines += [{"error": f"model_{what}"} for what in ("unreachable", "timeout", "overloaded")]
    url = serve(build({"s": scripted(find_object=lines)}).app)
    answers = [post(url, "/v1/find-object", find_body()) for _ in lines]
    assert [a.json()["outcome"] for a in answers[:3]] == ["answered", "unreadable", "refused"]
    assert [a.json()["found"] for a in answers[:3]] == [False, None, None]
    errors = [(a.status_code, a.json()["error"]["code"]) for a in answers[3:]]
    assert errors == [(503, "model_unreachable"), (504, "model_timeout"), (503, "model_overloaded")]
    assert int(answers[5].headers["retry-after"]) >= 1
    ended = post(url, "/v1/find-object", find_body())
    assert (ended.status_code, ended.json()["error"]["code"]) == (409, "script_ended")
    assert metric(url, "vlm_gateway_calls_total", role="recognition", outcome="refused") == 1
    assert metric(url, "vlm_gateway_calls_total", role="recognition", outcome="model_timeout") == 1


def test_before_take_off_a_model_is_asked_whether_it_knows_the_thing(serve: Serve, tmp_path: Path) -> None:
    model = EmbeddedModel(write_networks(tmp_path))
    embedded = EmbeddedBackend(model, alias="e", concurrency=1, queue=4, timeout_s=60.0)
    url = serve(build({"e": embedded, "s": scripted()}).app)
    assert post(url, "/v1/preflight", {}).json() == {"model": "e", "backend": "embedded", "known": None, "why": None}
    assert post(url, "/v1/preflight", {"object": "green plate"}).json()["known"] is True
    unknown = post(url, "/v1/preflight", {"object": "saxophone"}).json()
    assert unknown["known"] is False
    assert "saxophone" in unknown["why"]
    assert post(url, "/v1/preflight", {"model": "s", "object": "saxophone"}).json()["known"] is True
    refused = post(url, "/v1/preflight", {"model": "qwen"})
    assert (refused.status_code, refused.json()["error"]["code"]) == (422, "unknown_model")
    assert "no model 'qwen'; there are e, s" in refused.json()["error"]["message"]


def test_before_take_off_a_model_without_eyes_is_refused(serve: Serve) -> None:
    url = serve(build({"words": chat_backend(None, preset="generic-text")}).app)
    refused = post(url, "/v1/preflight", {"object": "plate"})
    assert refused.status_code == 422
    assert "takes no pictures" in refused.json()["error"]["message"]


def test_a_question_may_name_its_model_and_an_unknown_one_is_told_the_known(serve: Serve) -> None:
    first, second = scripted(floor_count=[{"floors": 1}]), scripted(floor_count=[{"floors": 2}])
    url = serve(build({"one": first, "two": second}).app)
    assert post(url, "/v1/floor-count", floors_body(model="two")).json()["floors"] == 2
    assert post(url, "/v1/floor-count", floors_body()).json()["floors"] == 1
    refused = post(url, "/v1/floor-count", floors_body(model="three"))
    assert refused.status_code == 422
    assert refused.json()["error"]["code"] == "unknown_model"
    assert refused.json()["error"]["details"]["models"] == ["one", "two"]


def test_the_second_time_the_answer_is_known(serve: Serve, mock: OpenAiMock, tmp_path: Path) -> None:
    mock.will(says('{"floors": 3}'), says('{"floors": 9}'))
    url = serve(build({"m": chat_backend(mock)}, cache=sqlite_cache(tmp_path)).app)
    first, second = (post(url, "/v1/floor-count", floors_body()) for _ in range(2))
    assert (first.headers["x-cache"], first.json()["cache"], first.json()["attempts"]) == ("miss", "miss", 1)
    assert (second.headers["x-cache"], second.json()["cache"], second.json()["attempts"]) == ("hit", "hit", 0)
    assert second.json()["floors"] == 3
    assert len(mock.asked) == 1
    other = post(url, "/v1/floor-count", floors_body(shade=7))
    assert (other.json()["cache"], other.json()["floors"]) == ("miss", 9)


def test_an_answer_tells_what_it_cost_where_that_is_known(serve: Serve, mock: OpenAiMock, tmp_path: Path) -> None:
    mock.will(says('{"floors": 3}'), says('{"floors": 3}'))
    models = {"dear": chat_backend(mock), "unpriced": chat_backend(mock, model="other")}
    url = serve(build(models, cache=sqlite_cache(tmp_path), prices={"dear": Price(prompt=2.0, completion=10.0)}).app)
    asked = [post(url, "/v1/floor-count", floors_body(model=m)).json() for m in ("dear", "dear", "unpriced")]
    assert [answer["cache"] for answer in asked] == ["miss", "hit", "miss"]
    assert [answer["usd"] for answer in asked] == [0.00027, None, None]


def test_what_an_answer_depends_on_is_in_the_key_and_what_it_does_not_is_not(
    serve: Serve, mock: OpenAiMock, tmp_path: Path
) -> None:
    mock.will(says('{"label": "a"}'))
    backends = {"m": chat_backend(mock), "warm": chat_backend(mock, temperature=0.7), "same": chat_backend(mock)}
    url = serve(build(backends, cache=sqlite_cache(tmp_path)).app)
    post(url, "/v1/choose-direction", direction_body())

    def state(headers: dict[str, str] | None = None, **changes: Any) -> str:
        return str(post(url, "/v1/choose-direction", direction_body(**changes), headers=headers).json()["cache"])

    assert state() == "hit"
    assert state({"x-oracle-vehicle": "e-17"}, model="same") == "hit"
    assert state(model="warm") == "miss"
    assert state(task="find the chair") == "miss"
    assert state(camera=camera_json(-45)) == "miss"
    assert state(points=direction_body()["points"][:3]) == "miss"


def test_only_answers_are_kept(serve: Serve, mock: OpenAiMock, tmp_path: Path) -> None:
    mock.will(says("hm"), says("hm"), says("I'm sorry, I can't."), status(400), says('{"floors": 3}'))
    url = serve(build({"m": chat_backend(mock)}, cache=sqlite_cache(tmp_path)).app)
    answers = [post(url, "/v1/floor-count", floors_body()) for _ in range(5)]
    assert [a.json().get("outcome") for a in answers] == ["unreadable", "refused", None, "answered", "answered"]
    assert [a.json().get("cache") for a in answers] == ["miss", "miss", None, "miss", "hit"]


def test_a_recorded_run_is_replayed_without_any_model(serve: Serve, mock: OpenAiMock, tmp_path: Path) -> None:
    mock.will(says('{"floors": 3}'))
    recording = build({"m": chat_backend(mock)}, cache=sqlite_cache(tmp_path))
    with_recording = serve(recording.app)
    post(with_recording, "/v1/floor-count", floors_body())
    wait_until(lambda: rows(tmp_path / "answers.sqlite") == 1)
    url = serve(build({"m": chat_backend(None)}, cache=sqlite_cache(tmp_path), mode="replay").app)
    known = post(url, "/v1/floor-count", floors_body())
    assert (known.json()["floors"], known.json()["cache"]) == (3, "hit")
    unknown = post(url, "/v1/floor-count", floors_body(shade=1))
    assert (unknown.status_code, unknown.json()["error"]["code"]) == (404, "not_recorded")


def test_with_the_cache_off_every_question_is_asked(serve: Serve, mock: OpenAiMock) -> None:
    mock.will(says('{"floors": 3}'))
    url = serve(build({"m": chat_backend(mock)}).app)
    for _ in range(3):
        assert post(url, "/v1/floor-count", floors_body()).headers["x-cache"] == "off"
    assert len(mock.asked) == 3


def test_identical_questions_at_once_are_one_call(serve: Serve, mock: OpenAiMock, tmp_path: Path) -> None:
    mock.will(says('{"floors": 3}', after_s=0.5))
    url = serve(build({"m": chat_backend(mock)}, cache=sqlite_cache(tmp_path)).app)
    with concurrent.futures.ThreadPoolExecutor(40) as threads:
        answers = list(threads.map(lambda _: post(url, "/v1/floor-count", floors_body()), range(40)))
    assert len(mock.asked) == 1
    assert {answer.json()["floors"] for answer in answers} == {3}
    assert sorted(answer.json()["cache"] for answer in answers).count("miss") == 1


def test_a_spoilt_entry_of_the_cache_is_asked_anew(serve: Serve, mock: OpenAiMock, tmp_path: Path) -> None:
    mock.will(says('{"floors": 3}'))
    url = serve(build({"m": chat_backend(mock)}, cache=sqlite_cache(tmp_path)).app)
    post(url, "/v1/floor-count", floors_body())
    wait_until(lambda: rows(tmp_path / "answers.sqlite") == 1)
    with sqlite3.connect(tmp_path / "answers.sqlite") as db:
        assert db.execute('UPDATE answers SET value = \'{"floors": "NaN"}\'').rowcount == 1
    db.close()
    again = post(url, "/v1/floor-count", floors_body())
    assert (again.status_code, again.json()["floors"], again.json()["cache"]) == (200, 3, "miss")


def test_the_caller_s_deadline_is_kept(serve: Serve) -> None:
    url = serve(build({"s": scripted(floor_count=[{"floors": 3, "delay_s": 30}])}).app)
    late = post(url, "/v1/floor-count", floors_body(), headers={"x-timeout-s": "0.2"})
    assert (late.status_code, late.json()["error"]["code"]) == (504, "model_timeout")
    wrong = post(url, "/v1/floor-count", floors_body(), headers={"x-timeout-s": "soon"})
    assert wrong.status_code == 422


def png_bomb() -> bytes:
    """A PNG of a few kilobytes that says it is 40,000 x 40,000."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", 40_000, 40_000, 8, 2, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", head)
        + chunk(b"IDAT", zlib.compress(bytes(1_000_000)))
        + chunk(b"IEND", b"")
    )


def jpeg_bomb() -> bytes:
    """A real JPEG whose frame header was changed to 60,000 x 60,000."""
    data = bytearray(base64.b64decode(encode_jpeg(np.zeros((8, 8, 3), np.uint8)).jpeg_base64))
    at = data.index(b"\xff\xc0")
    data[at + 5 : at + 9] = struct.pack(">HH", 60_000, 60_000)
    return bytes(data)


@pytest.mark.parametrize(
    ("image", "words"),
    [
        (base64.b64encode(png_bomb()).decode(), "send a JPEG"),
        (base64.b64encode(jpeg_bomb()).decode(), "60000 x 60000"),
        (base64.b64encode(b"GIF89a" + bytes(50)).decode(), "holds a gif picture; send a JPEG"),
        (base64.b64encode(b"\xff\xd8\xff").decode(), "ends before its frame header"),
        ("http://example.org/picture.jpg", "not valid base64"),
        ("///", "at least 4 characters"),
    ],
)
def test_a_bad_picture_is_told_apart_before_it_is_decoded(serve: Serve, image: str, words: str) -> None:
    url = serve(build({"s": scripted(floor_count=[{"floors": 3}])}).app)
    answer = post(url, "/v1/floor-count", {"image": {"jpeg_base64": image}})
    assert answer.status_code == 422
    assert words in answer.json()["error"]["message"]


@pytest.mark.parametrize(
    ("path", "body"),
    [
        ("/v1/floor-count", {}),
        ("/v1/floor-count", {"image": {"jpeg_base64": "AAAA"}, "extra": 1}),
        ("/v1/find-object", {**find_body(), "object": ""}),
        ("/v1/find-object", {**find_body(), "views": []}),
        ("/v1/find-object", find_body((0, 0))),
        ("/v1/find-object", {**find_body(), "views": [{**find_body()["views"][0], "camera": "front"}]}),
        ("/v1/choose-direction", {**direction_body(), "points": []}),
        ("/v1/choose-direction", direction_body("aa")),
    ],
)
def test_a_malformed_question_is_refused_by_name(serve: Serve, path: str, body: dict[str, Any]) -> None:
    url = serve(build({"s": scripted()}).app)
    answer = post(url, path, body)
    assert answer.status_code == 422
    assert answer.json()["error"]["message"]


def test_nan_and_broken_json_are_refused(serve: Serve) -> None:
    url = serve(build({"s": scripted()}).app)
    for body in (b'{"image": NaN', b"\xff\xfe", b"", b"[" * 100_000, b'{"image": {"jpeg_base64": 1}}'):
        answer = httpx.post(url + "/v1/floor-count", content=body, timeout=60)
        assert (answer.status_code, answer.json()["error"]["code"]) == (422, "invalid")


def test_a_gigabyte_is_refused_before_it_is_sent(serve: Serve) -> None:
    url = serve(build({"s": scripted()}).app)
    host, port = url.removeprefix("http://").split(":")
    with socket.create_connection((host, int(port)), timeout=60) as connection:
        head = f"POST /v1/find-object HTTP/1.1\r\nHost: {host}\r\nContent-Length: {1 << 30}\r\n\r\n"
        connection.sendall(head.encode())
        answer = connection.recv(4096)
    assert answer.startswith(b"HTTP/1.1 413")
    assert b"body_too_large" in answer


def test_status_models_and_readiness_tell_what_is_there(serve: Serve, mock: OpenAiMock, tmp_path: Path) -> None:
    backends: dict[str, Backend] = {"m": chat_backend(mock, key="sk-1"), "s": scripted()}
    url = serve(build(backends, cache=sqlite_cache(tmp_path)).app)
    listed = httpx.get(url + "/v1/models", timeout=60).json()
    assert [(model["id"], model["chat"]) for model in listed["data"]] == [("m", True), ("s", False)]
    state = httpx.get(url + "/v1/status", timeout=60)
    assert state.json()["models"]["m"]["breaker"] == "closed"
    assert state.json()["cache"]["mode"] == "on"
    assert "sk-1" not in state.text
    ready = httpx.get(url + "/readyz", timeout=60).json()
    assert (ready["status"], ready["checks"]["cache"]) == ("ready", "ok")
    routes = httpx.get(url + "/openapi.json", timeout=60).json()["paths"]
    assert "$ref" in str(routes["/v1/find-object"]["post"]["requestBody"])
