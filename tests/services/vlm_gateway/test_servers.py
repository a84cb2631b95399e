"""Each server preset against a small server that behaves as the real one: the four questions over real HTTP."""

import json
import re
from typing import Any

import cv2
import numpy as np
import pytest

from service_kit.errors import BadQuestion
from service_kit.settings import BadSetting
from services.vlm_gateway.backends.base import Picture
from services.vlm_gateway.chat import schemas
from services.vlm_gateway.chat.boxes import Size
from services.vlm_gateway.chat.grammar import gbnf
from services.vlm_gateway.config import chat_model
from services.vlm_gateway.model_configs import ChatModelConfig
from services.vlm_gateway.presets import families, servers
from services.vlm_gateway.reencode import fresh
from tests.conftest import Serve
from tests.services.vlm_gateway.kit import build, chat_backend, direction_body, find_body, floors_body, post
from tests.services.vlm_gateway.openai_mock import OpenAiMock, sends
from tests.services.vlm_gateway.quirky import QuirkyServer, Refusal, answers, openai_error, running

PRESETS = [
    "openai-compatible",
    "vllm",
    "vllm-guided",
    "vllm-structured",
    "ollama",
    "ollama-openai",
    "llama-cpp",
    "llama-cpp-grammar",
    "llama-cpp-python",
    "lm-studio",
    "transformers",
    "openai",
    "gemini",
    "dashscope",
    "openrouter",
]


def test_every_server_preset_is_tested() -> None:
    assert set(PRESETS) == set(servers())


def gateway(serve: Serve, server: QuirkyServer, kind: str, **changes: Any) -> str:
    values: dict[str, Any] = {"server": kind, "base_url": server.url, "timeout_s": 5.0} | changes
    return serve(build({"m": chat_backend(None, **values)}).app)


@pytest.mark.parametrize("preset", PRESETS)
def test_the_four_questions_are_put_in_each_server_s_own_words(serve: Serve, preset: str) -> None:
    with running(preset) as server:
        url = gateway(serve, server, preset)
        floors = post(url, "/v1/floor-count", floors_body()).json()
        box = post(url, "/v1/building-box", floors_body()).json()
        found = post(url, "/v1/find-object", find_body()).json()
        way = post(url, "/v1/choose-direction", direction_body()).json()
    assert (floors["outcome"], floors["floors"], floors["attempts"]) == ("answered", 3, 1)
    assert floors["tokens"] == {"prompt": 50, "completion": 5}
    assert box["box"] == {"x_min": 0.25, "y_min": 0.0, "x_max": 0.75, "y_max": 1.0}
    assert [match["camera"] for match in found["matches"]] == ["left"]
    assert way["label"] == "a"
    assert [seen.pictures for seen in server.asked] == [1, 1, 5, 1]


def test_ollama_is_asked_natively_with_each_picture_beside_its_words(serve: Serve) -> None:
    with running("ollama") as server:
        url = gateway(
            serve, server, "ollama", context_tokens=16384, extra={"options": {"top_k": 1}, "keep_alive": "5m"}
        )
        post(url, "/v1/find-object", find_body((-45, 0)))
    body = server.asked[0].body
    assert server.asked[0].path == "/api/chat"
    assert body["options"] == {"temperature": 0.0, "num_predict": 512, "num_ctx": 16384, "top_k": 1}
    assert body["format"]["required"] == ["found", "matches"]
    assert (body["keep_alive"], body["stream"]) == ("5m", False)
    left, ahead, question = body["messages"][1:]
    assert ("front left" in left["content"], len(left["images"])) == (True, 1)
    assert ("front." in ahead["content"], len(ahead["images"])) == (True, 1)
    assert "green flower pot" in question["content"]
    assert "images" not in question


def test_a_context_is_only_set_where_the_server_takes_one() -> None:
    values = {"backend": "chat", "model": "x", "preset": "gpt-4o", "server": "vllm", "context_tokens": 4096}
    with pytest.raises(BadSetting, match="only server 'ollama' takes it"):
        chat_model("m", ChatModelConfig.model_validate(values), "f")


def test_an_ollama_address_may_be_given_with_or_without_v1() -> None:
    values = {"backend": "chat", "model": "x", "preset": "gpt-4o", "server": "ollama"}
    for given in ("http://box:11434", "http://box:11434/", "http://box:11434/v1"):
        model = chat_model("m", ChatModelConfig.model_validate(values | {"base_url": given}), "f")
        assert model.base_url == "http://box:11434/v1"


@pytest.mark.parametrize(
    ("server_kind", "asked_as"),
    [
        ("lm-studio", "json_object"),
        ("dashscope", "json_schema"),
        ("vllm", "guided_json"),
        ("llama-cpp-python", "json_schema"),
    ],
)
def test_a_dialect_the_server_refuses_is_left_out_from_then_on(serve: Serve, server_kind: str, asked_as: str) -> None:
    with running(server_kind) as server:
        url = gateway(serve, server, server_kind, structured=asked_as)
        for shade in (1, 2):
            assert post(url, "/v1/floor-count", floors_body(shade)).json()["floors"] == 3
    assert all("response_format" not in seen.body and "guided_json" not in seen.body for seen in server.asked)
    assert len(server.asked) == 2  # of which none was refused: only the very first question had to be put twice


def test_a_model_that_is_loading_is_waited_for(serve: Serve) -> None:
    with running("llama-cpp", loading=3) as server:
        answer = post(gateway(serve, server, "llama-cpp"), "/v1/floor-count", floors_body()).json()
    assert (answer["outcome"], answer["attempts"]) == ("answered", 4)


def test_a_model_that_loads_beyond_the_deadline_is_told_as_such(serve: Serve) -> None:
    with running("llama-cpp", loading=1000) as server:
        answer = post(gateway(serve, server, "llama-cpp", timeout_s=1.0), "/v1/floor-count", floors_body())
    error = answer.json()["error"]
    assert (answer.status_code, error["code"], error["details"]["reason"]) == (503, "model_overloaded", "loading")


ERRORS = [
    ("OpenAI", 400, {"error": {"message": "bad", "type": "invalid_request_error"}}, 502, "model_rejected"),
    ("a bare string", 500, {"error": "llama runner process has terminated"}, 503, "model_unreachable"),
    ("a trace", 500, {"error": {"message": 'bad\n File "/srv/x.py", line 3'}}, 503, "model_unreachable"),
    ("FastAPI", 422, {"detail": "Unexpected fields in the request: {'seed'}"}, 502, "model_rejected"),
    ("FastAPI's list", 422, {"detail": [{"loc": ["body"], "msg": "field required"}]}, 502, "model_rejected"),
    ("OpenRouter in a 200", 200, {"error": {"code": 429, "message": "rate limited"}}, 503, "model_overloaded"),
    ("OpenRouter, no credit", 402, {"error": {"code": 402, "message": "Insufficient credits"}}, 502, "model_rejected"),
    (
        "OpenRouter in a choice",
        200,
        {"choices": [{"error": {"code": 502, "message": "provider failed"}, "finish_reason": "error"}]},
        503,
        "model_unreachable",
    ),
    ("vLLM until 2025", 200, {"object": "error", "message": "too long", "code": 400}, 502, "model_rejected"),
    ("DashScope's own", 200, {"code": "Throttling.RateQuota", "message": "slow", "type": ""}, 503, "model_overloaded"),
    ("LM Studio in a 200", 200, {"error": "Unexpected endpoint or method. (POST /chat)"}, 503, "model_unreachable"),
    ("Ollama is full", 503, {"error": "server busy, please try again."}, 503, "model_overloaded"),
    ("Ollama, no model", 404, {"error": "model 'x' not found"}, 502, "model_rejected"),
]


@pytest.mark.parametrize(("status", "body", "code", "word"), [e[1:] for e in ERRORS], ids=[e[0] for e in ERRORS])
def test_each_server_s_errors_are_told_apart(serve: Serve, status: int, body: Any, code: int, word: str) -> None:
    def fails(_: str) -> str:
        raise Refusal(status, body)

    with running("openai-compatible", fails) as server:
        answer = post(gateway(serve, server, "openai-compatible"), "/v1/floor-count", floors_body())
    assert (answer.status_code, answer.json()["error"]["code"]) == (code, word)
    assert "/srv" not in answer.text


def chunk(**choice: object) -> bytes:
    event = {"object": "chat.completion.chunk", "choices": [{"index": 0, "delta": {}, **choice}]}
    return b"data: " + json.dumps(event).encode() + b"\n\n"


@pytest.mark.parametrize(
    ("last", "whole"),
    [
        (chunk(finish_reason="stop"), True),  # transformers serve, which sends no [DONE]
        (chunk(finish_reason="stop") + b"data: [DONE]\n\n", True),
        (chunk(finish_reason="stop")[:-3], False),
        (chunk(finish_reason=None), False),
        (chunk(delta={"content": '"finish_reason": "stop"'}), False),
    ],
)
def test_a_stream_is_whole_when_it_says_why_it_ends(serve: Serve, mock: OpenAiMock, last: bytes, whole: bool) -> None:
    mock.will(sends(chunk(delta={"content": "hi"}) + last, kind="text/event-stream"))
    url = serve(build({"m": chat_backend(mock)}).app)
    chat = {"model": "m", "stream": True, "messages": [{"role": "user", "content": "hello"}]}
    assert ("model_unreachable" in post(url, "/v1/chat/completions", chat).text) is not whole


@pytest.mark.parametrize(
    ("status", "said"), [(400, "unsupported image format"), (400, "the context is too long"), (404, "no such model")]
)
def test_a_refusal_that_is_not_about_the_dialect_leaves_the_dialect_alone(serve: Serve, status: int, said: str) -> None:
    asked = 0

    def refuses_once(words: str) -> str:
        nonlocal asked
        asked += 1
        if asked == 1:
            raise openai_error(status, said)
        return answers(words)

    with running("vllm", refuses_once) as server:
        url = gateway(serve, server, "vllm")
        assert post(url, "/v1/floor-count", floors_body()).json()["error"]["code"] == "model_rejected"
        assert post(url, "/v1/floor-count", floors_body()).json()["floors"] == 3
    assert "response_format" in server.asked[-1].body


FILTERS = [
    ("OpenAI", 400, {"error": {"message": "rejected by our safety system", "code": "content_policy_violation"}}),
    ("Azure", 400, {"error": {"message": "filtered", "code": "content_filter"}}),
    ("DashScope", 400, {"error": {"message": "Input may be inappropriate", "code": "data_inspection_failed"}}),
    ("OpenRouter", 403, {"error": {"message": "Your input was flagged", "code": 403}}),
]


@pytest.mark.parametrize(("status", "body"), [f[1:] for f in FILTERS], ids=[f[0] for f in FILTERS])
def test_a_content_filter_s_error_is_a_refusal_of_the_model(serve: Serve, status: int, body: Any) -> None:
    def declines(_: str) -> str:
        raise Refusal(status, body)

    with running("openai-compatible", declines) as server:
        answer = post(gateway(serve, server, "openai-compatible"), "/v1/floor-count", floors_body()).json()
    assert (answer["outcome"], answer["floors"], answer["text"]) == ("refused", None, body["error"]["message"])


def expression(grammar: str) -> str:
    """A grammar as a regular expression. Ours have no rules that call themselves."""
    rules = dict(line.split(" ::= ", 1) for line in grammar.strip().splitlines())

    def of(rule: str) -> str:
        pattern = ""
        for token in re.findall(r'"(?:[^"\\]|\\.)*"|\[[^\]]*\]|\{[^}]*\}|[a-z]+|\S', rule):
            if token.startswith('"'):
                pattern += "(?:" + re.escape(json.loads(token)) + ")"
            elif token in rules:
                pattern += f"(?:{of(rules[token])})"
            else:
                pattern += token
        return pattern

    return of(rules["root"])


def test_the_grammars_let_the_right_answers_through_and_no_others() -> None:
    boxes = schemas.BoxForm("bbox", "unit", "xyxy", 28, 1, 10**7)
    forms = {
        "floors": (schemas.floors_form(), ['{"floors":3}', '{ "floors": 12 }'], ['{"floors":-1}', '{"floors":3.5}']),
        "building": (
            schemas.building_form(boxes),
            ['{"bbox":null}', '{"bbox": [0.1, 0.2, 1, 0.9]}'],
            ['{"bbox":[1,2,3]}', '{"bbox":"left"}'],
        ),
        "find": (
            schemas.find_form(boxes, 5),
            [
                '{"found":false, "matches":[]}',
                '{"found":true, "matches":[{"view":1, "bbox":[0,0,1,1], "confidence":0.5}]}',
            ],
            ['{"found":true}', '{"found":1, "matches":[]}'],
        ),
        "choice": (schemas.choice_form(["a", "c"]), ['{"label":"c"}'], ['{"label":"b"}', "c"]),
    }
    for form, good, bad in forms.values():
        pattern = re.compile(expression(gbnf(form.schema)))
        assert all(pattern.fullmatch(text) for text in good)
        assert not any(pattern.fullmatch(text) for text in bad)
    with pytest.raises(ValueError, match="no grammar"):
        gbnf({"type": "string"})


def jpeg(pixels: Any, quality: int = 95) -> Picture:
    ok, data = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, quality])
    assert ok
    return Picture(data.tobytes(), pixels.shape[1], pixels.shape[0])


def test_what_a_server_sees_is_encoded_anew() -> None:
    picture = jpeg(np.full((60, 80, 3), 200, np.uint8))
    # Exif with orientation 6 (turned by a quarter), and words behind the end
    tiff = b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0"
    exif = b"\xff\xe1" + (8 + len(tiff)).to_bytes(2, "big") + b"Exif\0\0" + tiff
    odd = Picture(picture.jpeg[:2] + exif + picture.jpeg[2:] + b"GPS 48.1 11.5", 80, 60)
    clean = fresh(odd, max_pixels=10**6, max_side=1000, max_bytes=10**6)
    assert (clean.width, clean.height) == (80, 60)
    assert b"Exif" not in clean.jpeg
    assert b"GPS" not in clean.jpeg
    decoded = cv2.imdecode(np.frombuffer(clean.jpeg, np.uint8), cv2.IMREAD_COLOR)
    assert decoded is not None
    assert decoded.shape == (60, 80, 3)


def test_a_picture_over_the_limits_is_scaled_and_packed_to_fit() -> None:
    noise = np.random.default_rng(1).integers(0, 255, (400, 800, 3), np.uint8)
    picture = jpeg(noise)
    assert Size(*fresh(picture, max_pixels=80_000, max_side=8000, max_bytes=10**7)[1:]) == (400, 200)
    assert Size(*fresh(picture, max_pixels=10**7, max_side=200, max_bytes=10**7)[1:]) == (200, 100)
    packed = fresh(picture, max_pixels=10**7, max_side=8000, max_bytes=250_000)
    assert len(packed.jpeg) <= 250_000 < len(fresh(picture, max_pixels=10**7, max_side=8000, max_bytes=10**7).jpeg)
    with pytest.raises(BadQuestion, match="can't be made smaller"):
        fresh(picture, max_pixels=10**7, max_side=8000, max_bytes=10_000)


def test_a_picture_that_is_only_a_header_is_the_caller_s_fault(serve: Serve) -> None:
    with running("openai-compatible") as server:
        url = gateway(serve, server, "openai-compatible")
        body = floors_body()
        body["image"]["jpeg_base64"] = body["image"]["jpeg_base64"][:240]
        answer = post(url, "/v1/floor-count", body)
    assert (answer.status_code, answer.json()["error"]["code"]) == (422, "bad_image")
    assert server.asked == []


def test_boxes_may_be_told_otherwise_than_the_preset_says(serve: Serve) -> None:
    def as_xywh(words: str) -> str:
        return '{"bbox_2d": [20, 15, 40, 30]}' if '"bbox_2d"' in words else answers(words)

    with running("vllm", as_xywh) as server:
        url = gateway(serve, server, "vllm", preset="qwen2-vl", boxes="pixels", box_order="xywh")
        box = post(url, "/v1/building-box", floors_body()).json()["box"]
    assert box == {"x_min": 0.25, "y_min": 0.25, "x_max": 0.75, "y_max": 0.75}
    assert (
        "[x_min, y_min, width, height] in pixels of the picture, which is 80 wide and 60 high" in server.asked[0].words
    )


def test_presets_name_their_sources() -> None:
    nameless = {"generic-text", "generic-vision", "openai-compatible"}
    named = {name: family.sources for name, family in families().items()}
    named |= {name: server.sources for name, server in servers().items()}
    for name, sources in named.items():
        assert name in nameless or sources, name
        assert all(source.startswith("https://") for source in sources)
