"""What clients send beside words, and what of it a model's server gets to see; over real HTTP to a mock server."""

import base64
import zlib
from typing import Any

import cv2
import httpx
import numpy as np
import pytest

from services.vlm_gateway.config import ChatLimits
from tests.conftest import Serve
from tests.services.vlm_gateway.kit import build, chat_backend, post
from tests.services.vlm_gateway.openai_mock import OpenAiMock

PATH = "/v1/chat/completions"
QUESTION = {"role": "user", "content": "what is 6 times 7?"}
CALL = {"id": "c1", "type": "function", "function": {"name": "product", "arguments": "{}"}}
RESULT = {"role": "tool", "tool_call_id": "c1", "content": "42"}
# the assistant's message as vLLM 0.11 and as litellm's SDK give it, sent back in the second turn of a tool loop
ECHOES: dict[str, dict[str, Any]] = {
    "vllm": {
        "role": "assistant", "content": None, "refusal": None, "annotations": None, "audio": None,
        "function_call": None, "tool_calls": [CALL], "reasoning": "multiply", "reasoning_content": "multiply",
    },
    "litellm": {
        "content": None, "role": "assistant", "tool_calls": [{**CALL, "index": 0}], "function_call": None,
        "provider_specific_fields": {"refusal": None}, "annotations": [], "thinking_blocks": [{"type": "thinking"}],
    },
}  # fmt: skip


def body(*messages: Any, **more: Any) -> dict[str, Any]:
    return {"model": "m", "messages": list(messages) or [QUESTION], **more}


def answered(serve: Serve, mock: OpenAiMock, asked: dict[str, Any], **model: Any) -> dict[str, Any]:
    """What the model's server was asked."""
    answer = post(serve(build({"m": chat_backend(mock, **model)}).app), PATH, asked)
    assert answer.status_code == 200, answer.text
    return mock.asked[-1].body


@pytest.mark.parametrize("echo", ECHOES.values(), ids=ECHOES)
def test_a_strict_server_gets_only_the_standard_fields_of_an_echoed_message(
    serve: Serve, mock: OpenAiMock, echo: dict[str, Any]
) -> None:
    sent = answered(serve, mock, body(QUESTION, echo, RESULT), server="openai-compatible")
    assert sent["messages"] == [
        QUESTION,
        {"role": "assistant", "content": None, "tool_calls": echo["tool_calls"]},
        RESULT,
    ]


def test_vllm_gets_what_the_model_thought(serve: Serve, mock: OpenAiMock) -> None:
    sent = answered(serve, mock, body(QUESTION, ECHOES["vllm"], RESULT), server="vllm")
    assert sent["messages"][1] == {
        "role": "assistant",
        "content": None,
        "tool_calls": [CALL],
        "reasoning": "multiply",
        "reasoning_content": "multiply",
    }


def test_a_model_s_own_lists_add_to_its_server_s(serve: Serve, mock: OpenAiMock) -> None:
    part = {"type": "text", "text": "hi", "cache_control": {"type": "ephemeral"}, "other": 1}
    asked = body({"role": "user", "content": [part], "mood": "good", "weather": "bad"}, enable_x=True)
    lists = {"pass": ["enable_x"], "message_fields": ["mood"], "part_fields": ["cache_control"]}
    sent = answered(serve, mock, asked, server="openai-compatible", **lists)
    assert sent["enable_x"] is True
    del part["other"]
    assert sent["messages"] == [{"role": "user", "content": [part], "mood": "good"}]


def test_parts_that_an_assistant_thought_are_dropped(serve: Serve, mock: OpenAiMock) -> None:
    thought = {"role": "assistant", "content": [{"type": "thinking", "thinking": "hm"}, {"type": "text", "text": "42"}]}
    sent = answered(serve, mock, body(QUESTION, thought, QUESTION), server="openai-compatible")
    assert sent["messages"][1]["content"] == [{"type": "text", "text": "42"}]


@pytest.mark.parametrize(
    "field", ["chat_template_kwargs", "mm_processor_kwargs", "structured_outputs", "stop_token_ids"]
)
def test_fields_of_a_server_s_own_reach_it_and_no_other(serve: Serve, mock: OpenAiMock, field: str) -> None:
    asked = body(**{field: {"x": 1}})
    assert answered(serve, mock, asked, server="vllm")[field] == {"x": 1}
    assert answered(serve, mock, asked, server="openai-compatible", **{"pass": [field]})[field] == {"x": 1}
    refused = post(serve(build({"m": chat_backend(mock, server="lm-studio")}).app), PATH, asked)
    assert (refused.status_code, refused.json()["error"]["code"]) == (422, "unknown_field")
    assert f"{field}: model 'm' is not known to take it" in refused.json()["error"]["message"]


def test_null_says_nothing_whatever_it_is_called(serve: Serve, mock: OpenAiMock) -> None:
    sent = answered(serve, mock, body(anything=None, seed=None), server="openai-compatible")
    assert sent == {"model": "maker/model-1", "messages": [QUESTION]}


@pytest.mark.parametrize(("server", "role"), [("openai", "developer"), ("vllm", "system"), ("llama-cpp", "system")])
def test_developer_is_system_where_the_server_knows_only_that(
    serve: Serve, mock: OpenAiMock, server: str, role: str
) -> None:
    sent = answered(serve, mock, body({"role": "developer", "content": "be brief"}, QUESTION), server=server)
    assert sent["messages"] == [{"role": role, "content": "be brief"}, QUESTION]


def test_a_fallback_that_would_not_take_all_of_it_is_not_asked(serve: Serve, mock: OpenAiMock) -> None:
    first = chat_backend(None, alias="m", server="vllm", fallbacks=["other"], retries=0)
    other = chat_backend(mock, alias="other", server="openai-compatible")
    url = serve(build({"m": first, "other": other}).app)
    assert post(url, PATH, body()).status_code == 200
    mock.asked.clear()
    assert post(url, PATH, body(stop_token_ids=[1])).status_code == 503
    assert mock.asked == []


def test_parts_that_a_model_takes_are_passed_unless_something_would_be_fetched(serve: Serve, mock: OpenAiMock) -> None:
    def spoken(url: str) -> dict[str, Any]:
        return {"role": "user", "content": [{"type": "video_url", "video_url": {"url": url}}]}

    url = serve(build({"m": chat_backend(mock, part_types=["video_url"])}).app)
    assert post(url, PATH, body(spoken("data:video/mp4;base64,AAAA"))).status_code == 200
    refused = post(url, PATH, body(spoken("http://169.254.169.254/x")))
    assert (refused.status_code, refused.json()["error"]["code"]) == (422, "no_urls")


def photo(width: int, height: int, form: str, *, alpha: bool = False) -> bytes:
    pixels = np.full((height, width, 4 if alpha else 3), 200, np.uint8)
    pixels[: height // 2] = 30
    ok, data = cv2.imencode(form, pixels)
    assert ok
    return data.tobytes()


def shown(data: bytes, kind: str = "image/jpeg") -> dict[str, Any]:
    url = f"data:{kind};base64,{base64.b64encode(data).decode()}"
    return {"role": "user", "content": [{"type": "image_url", "image_url": {"url": url, "detail": "low"}}]}


def seen(sent: dict[str, Any]) -> tuple[str, Any]:
    """The type and the pixels of the picture that the server got."""
    kind, _, data = sent["messages"][0]["content"][0]["image_url"]["url"].partition(";base64,")
    pixels = cv2.imdecode(np.frombuffer(base64.b64decode(data), np.uint8), cv2.IMREAD_COLOR)
    assert pixels is not None
    return kind, pixels


def test_photographs_of_drones_and_phones_are_scaled_to_what_the_model_takes(serve: Serve, mock: OpenAiMock) -> None:
    url = serve(build({"m": chat_backend(mock, preset="generic-vision", max_pixels=2_000_000)}).app)
    for width, height in ((5280, 3956), (8064, 6048), (6048, 8064), (8192, 2000)):
        assert post(url, PATH, body(shown(photo(width, height, ".jpg")))).status_code == 200
        kind, pixels = seen(mock.asked[-1].body)
        assert kind == "data:image/jpeg"
        assert 1_900_000 < pixels.shape[0] * pixels.shape[1] <= 2_000_000
        assert pixels.shape[1] / pixels.shape[0] == pytest.approx(width / height, rel=0.01)
        assert mock.asked[-1].body["messages"][0]["content"][0]["image_url"]["detail"] == "low"


@pytest.mark.parametrize(
    ("server", "form", "kind", "passed"),
    [
        ("openai-compatible", ".webp", "image/webp", "data:image/jpeg"),
        ("vllm", ".webp", "image/webp", "data:image/webp"),
        ("vllm", ".gif", "image/gif", "data:image/jpeg"),
        ("openai-compatible", ".png", "image/jpeg", "data:image/png"),
        ("openai-compatible", ".jpg", "image/JPEG", "data:image/jpeg"),
        ("openai-compatible", ".jpg", "image/jpeg;charset=utf-8", "data:image/jpeg"),
    ],
)
def test_pictures_go_on_as_what_they_are_in_a_form_that_the_server_takes(
    serve: Serve, mock: OpenAiMock, server: str, form: str, kind: str, passed: str
) -> None:
    data = photo(64, 48, form)
    sent = answered(serve, mock, body(shown(data, kind)), server=server)
    told, pixels = seen(sent)
    assert (told, pixels.shape) == (passed, (48, 64, 3))
    assert abs(int(pixels[40, 32, 1]) - 200) < 25
    if passed.endswith(form.strip(".").replace("jpg", "jpeg")):
        assert base64.b64encode(data).decode() in sent["messages"][0]["content"][0]["image_url"]["url"]


def test_a_picture_that_fits_is_passed_byte_for_byte_and_one_turned_by_its_camera_stands_upright(
    serve: Serve, mock: OpenAiMock
) -> None:
    plain = photo(60, 40, ".jpg")
    exif = b"Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0"  # orientation 6: turned right
    turned = plain[:2] + b"\xff\xe1" + (len(exif) + 2).to_bytes(2, "big") + exif + plain[2:]
    whole = answered(serve, mock, body(shown(turned)))
    assert base64.b64encode(turned).decode() in whole["messages"][0]["content"][0]["image_url"]["url"]
    _, pixels = seen(answered(serve, mock, body(shown(turned)), preset="generic-vision", max_pixels=600))
    assert pixels.shape[0] > pixels.shape[1]


def test_a_png_that_was_turned_by_its_camera_stands_upright(serve: Serve, mock: OpenAiMock) -> None:
    plain = photo(60, 40, ".png")
    exif = b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0"  # orientation 6: turned right
    chunk = b"eXIf" + exif
    chunk = len(exif).to_bytes(4, "big") + chunk + zlib.crc32(chunk).to_bytes(4, "big")
    turned = plain[:33] + chunk + plain[33:]  # behind the signature and the header's chunk
    asked = body(shown(turned, "image/png"))
    _, pixels = seen(answered(serve, mock, asked, preset="generic-vision", max_pixels=600))
    assert pixels.shape[0] > pixels.shape[1]


def test_what_is_transparent_lies_on_white(serve: Serve, mock: OpenAiMock) -> None:
    pixels = np.zeros((40, 60, 4), np.uint8)
    data = cv2.imencode(".png", pixels)[1].tobytes()
    _, got = seen(answered(serve, mock, body(shown(data, "image/png")), preset="generic-vision", max_pixels=600))
    assert int(got.min()) > 250


def test_the_limits_are_settings(serve: Serve, mock: OpenAiMock) -> None:
    limits = ChatLimits(messages=2, pictures=1, tokens=100, picture_side=50, picture_pixels=2000, body_bytes=20_000)
    url = serve(build({"m": chat_backend(mock)}, limits=limits).app)
    refused = {
        "messages": body(QUESTION, QUESTION, QUESTION),
        "pictures": body(shown(photo(40, 40, ".png")), shown(photo(40, 40, ".png"))),
        "tokens": body(max_tokens=101),
        "side": body(shown(photo(60, 20, ".png"))),
        "pixels": body(shown(photo(48, 48, ".png"))),
    }
    for name, asked in refused.items():
        answer = post(url, PATH, asked)
        assert answer.status_code == 422, name
        assert any(limit in answer.text for limit in ("at most", "1 to 2", "1 to 100")), name
    assert post(url, PATH, body({"role": "user", "content": "x" * 20_000})).status_code == 413
    assert post(url, PATH, body(shown(photo(40, 40, ".png")), max_tokens=100)).status_code == 200


def test_models_are_listed_for_the_key_that_asks_chat_models_first(serve: Serve, mock: OpenAiMock) -> None:
    alias = "Qwen/Qwen2.5-VL-7B-Instruct"
    url = serve(build({"aaa": chat_backend(mock, alias="aaa"), alias: chat_backend(mock, alias=alias)}).app)
    listed = httpx.get(url + "/v1/models", timeout=60).json()["data"]
    assert [model["id"] for model in listed] == [alias, "aaa"]
    assert httpx.get(f"{url}/v1/models/{alias}", timeout=60).json()["id"] == alias
    assert post(url, PATH, body(model=alias) | {"model": alias}).status_code == 200
    for missing in (httpx.get(url + "/v1/models/gpt-9", timeout=60), post(url, PATH, {**body(), "model": "gpt-9"})):
        assert (missing.status_code, missing.json()["error"]["code"]) == (404, "model_not_found")
