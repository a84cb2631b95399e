"""Embeddings, completions and responses, passed through to a mock server over real HTTP."""

import json
from typing import Any

import openai
import pytest

from services.vlm_gateway.config import KeyConfig
from services.vlm_gateway.keys import Keys, new_key
from tests.conftest import Serve
from tests.services.vlm_gateway.kit import build, chat_backend, metric, post
from tests.services.vlm_gateway.openai_mock import OpenAiMock, sends, status

EMBEDDING = {
    "object": "list",
    "model": "maker/model-1",
    "data": [{"object": "embedding", "index": 0, "embedding": [0.5, -0.25]}],
    "usage": {"prompt_tokens": 5, "total_tokens": 5},
}
COMPLETION = {
    "id": "cmpl-1",
    "object": "text_completion",
    "created": 1_700_000_000,
    "model": "maker/model-1",
    "choices": [{"index": 0, "text": " world", "finish_reason": "stop", "logprobs": None}],
    "usage": {"prompt_tokens": 2, "completion_tokens": 1, "total_tokens": 3},
}
RESPONSE = {"id": "resp_1", "object": "response", "output": [], "usage": {"input_tokens": 4, "output_tokens": 3}}


def says(body: dict[str, Any]) -> Any:
    return sends(json.dumps(body).encode())


def test_openai_s_client_gets_embeddings_and_completions(serve: Serve, mock: OpenAiMock) -> None:
    url = serve(build({"m": chat_backend(mock)}).app)
    with openai.OpenAI(base_url=url + "/v1", api_key="none", max_retries=0) as client:
        mock.will(says(EMBEDDING))
        made = client.embeddings.create(model="m", input="a flower pot", encoding_format="float")
        assert made.data[0].embedding == [0.5, -0.25]
        assert (mock.asked[0].target, mock.asked[0].body["model"]) == ("/v1/embeddings", "maker/model-1")
        mock.will(says(COMPLETION))
        assert client.completions.create(model="m", prompt="hello").choices[0].text == " world"
    assert metric(url, "vlm_gateway_tokens_total", model="m", kind="prompt") == 7


def test_responses_are_passed_but_nothing_is_kept_at_the_server(serve: Serve, mock: OpenAiMock) -> None:
    mock.will(says(RESPONSE))
    url = serve(build({"m": chat_backend(mock)}).app)
    answer = post(url, "/v1/responses", {"model": "m", "input": "hi", "store": True, "max_output_tokens": 20})
    assert (answer.status_code, answer.json()["id"], answer.headers["x-model"]) == (200, "resp_1", "m")
    assert mock.asked[0].body == {"model": "maker/model-1", "input": "hi", "store": False, "max_output_tokens": 20}
    assert metric(url, "vlm_gateway_tokens_total", model="m", kind="completion") == 3


@pytest.mark.parametrize(
    ("route", "body", "code"),
    [
        ("embeddings", {"input": "x", "model": 3}, "invalid"),
        ("embeddings", {"model": "m"}, "invalid"),
        ("completions", {"model": "m", "prompt": "x", "n": 5}, "invalid"),
        ("completions", {"model": "m", "prompt": "x", "stream": True}, "invalid"),
        ("responses", {"model": "m", "input": "x", "previous_response_id": "resp_1"}, "invalid"),
        (
            "responses",
            {"model": "m", "input": [{"content": [{"type": "input_image", "image_url": "http://169.254.169.254/"}]}]},
            "no_urls",
        ),
    ],
)
def test_what_would_fetch_keep_or_multiply_is_refused(
    serve: Serve, mock: OpenAiMock, route: str, body: dict[str, Any], code: str
) -> None:
    refused = post(serve(build({"m": chat_backend(mock)}).app), f"/v1/{route}", body)
    assert (refused.status_code, refused.json()["error"]["code"]) == (422, code)
    assert mock.asked == []


def test_keys_and_fallbacks_are_those_of_chats(serve: Serve, mock: OpenAiMock) -> None:
    made = new_key()
    keys = Keys({"k": KeyConfig(sha256=made.sha256, models=("m", "other"))})
    backends = {
        "m": chat_backend(None, retries=0, fallbacks=["other"]),
        "other": chat_backend(mock, alias="other"),
        "secret": chat_backend(mock, alias="secret"),
    }
    url = serve(build(backends, keys=keys).app)
    mine = {"authorization": f"Bearer {made.key}"}
    assert post(url, "/v1/embeddings", {"model": "m", "input": "x"}).status_code == 401
    assert post(url, "/v1/embeddings", {"model": "secret", "input": "x"}, headers=mine).status_code == 403
    assert post(url, "/v1/embeddings", {"model": "gpt-9", "input": "x"}, headers=mine).status_code == 404
    mock.will(says(EMBEDDING))
    answer = post(url, "/v1/embeddings", {"model": "m", "input": "x"}, headers=mine)
    assert (answer.status_code, answer.headers["x-model"]) == (200, "other")
    mock.will(status(400))
    assert post(url, "/v1/embeddings", {"model": "other", "input": "x"}, headers=mine).status_code == 400
