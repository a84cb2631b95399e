"""How long a message is, as Anthropic's clients ask before they send one; and what the description says of errors."""

import httpx
import pytest

from services.vlm_gateway.config import KeyConfig
from services.vlm_gateway.keys import Keys, new_key
from tests.conftest import Serve
from tests.services.vlm_gateway.anthropic.test_messages import PICTURE, TOOL, asks
from tests.services.vlm_gateway.kit import build, chat_backend, metric, post
from tests.services.vlm_gateway.openai_mock import OpenAiMock

PATH = "/v1/messages/count_tokens"


@pytest.fixture
def url(serve: Serve, mock: OpenAiMock) -> str:
    return serve(build({"m": chat_backend(mock)}).app)


def test_a_message_is_counted_by_an_estimate_and_no_model_is_asked(url: str, mock: OpenAiMock) -> None:
    short, long = (post(url, PATH + "?beta=true", asks(words)) for words in ("hi", "hi" * 2000))
    assert (short.status_code, long.status_code) == (200, 200)
    assert short.json()["estimated"] is True
    assert long.json()["input_tokens"] - short.json()["input_tokens"] == pytest.approx(1000, abs=2)
    assert short.headers["x-model"] == "m"
    assert len(mock.asked) == 0
    assert metric(url, "vlm_gateway_tokens_total") == 0


def test_pictures_tools_and_the_system_s_words_count(url: str) -> None:
    plain = post(url, PATH, asks("hi")).json()["input_tokens"]
    assert post(url, PATH, asks([PICTURE])).json()["input_tokens"] >= 1000
    assert post(url, PATH, asks("hi", tools=[TOOL])).json()["input_tokens"] > plain + 10
    assert post(url, PATH, asks("hi", system="be short " * 100)).json()["input_tokens"] > plain + 200


def test_what_can_t_be_counted_is_refused_as_a_message_is(serve: Serve, mock: OpenAiMock) -> None:
    key = new_key()
    config = KeyConfig(sha256=key.sha256, models=("m",), requests_per_minute=3)
    app = build({"m": chat_backend(mock), "n": chat_backend(mock, alias="n")}, keys=Keys({"a": config})).app
    url, mine = serve(app), {"x-api-key": key.key}
    assert post(url, PATH, asks()).json()["error"]["type"] == "authentication_error"
    assert post(url, PATH, asks() | {"model": "n"}, headers=mine).json()["error"]["type"] == "permission_error"
    assert post(url, PATH, asks() | {"model": "x"}, headers=mine).json()["error"]["type"] == "not_found_error"
    assert post(url, PATH, {"model": "m"}, headers=mine).status_code == 400
    assert post(url, PATH, asks(), headers=mine).json()["error"]["type"] == "rate_limit_error"


def test_the_description_says_that_errors_have_anthropic_s_form(url: str) -> None:
    described = httpx.get(url + "/openapi.json", timeout=60).json()
    for path, form in (("/v1/messages", "MessagesError"), (PATH, "MessagesError"), ("/v1/responses", "ErrorBody")):
        answers = described["paths"][path]["post"]["responses"]
        for status in ("400", "401", "413", "429", "503"):
            schema = answers[status]["content"]["application/json"]["schema"]
            named = [one["$ref"].rpartition("/")[2] for one in schema.get("anyOf", [schema])]
            assert named[0] == form, (path, status)
            assert set(named) <= {form, "ErrorBody"}, "before a caller's form is known, errors have the usual one"
