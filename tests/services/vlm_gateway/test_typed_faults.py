"""The fault table of the typed questions: every fault of a model's server ends in its own typed outcome."""

from typing import Any

import httpx
import pytest

from tests.conftest import Serve
from tests.services.vlm_gateway.faults import EMPTY_CHOICES, FAULTS, Fault, suffering
from tests.services.vlm_gateway.kit import (
    build,
    chat_backend,
    direction_body,
    find_body,
    floors_body,
    metric,
    post,
    sqlite_cache,
)
from tests.services.vlm_gateway.openai_mock import OpenAiMock, says, status

QUESTIONS: dict[str, dict[str, Any]] = {
    "floor-count": floors_body(),
    "building-box": floors_body(),
    "find-object": find_body(),
    "choose-direction": direction_body(),
}
CONTENT = {"floor-count": "floors", "building-box": "box", "find-object": "found", "choose-direction": "label"}


def gateway(serve: Serve, address: str, deadline_s: float = 15.0) -> str:
    return serve(build({"m": chat_backend(None, base_url=address, timeout_s=deadline_s)}).app)


@pytest.mark.parametrize("fault", FAULTS, ids=[fault.name for fault in FAULTS])
def test_a_fault_ends_in_its_typed_outcome(serve: Serve, mock: OpenAiMock, fault: Fault) -> None:
    with suffering(fault, mock) as address:
        url = gateway(serve, address, fault.deadline_s)
        for path, body in QUESTIONS.items():
            mock.asked.clear()
            answer = post(url, "/v1/" + path, body)
            check(answer, fault, CONTENT[path])
            # once the breaker is open, nobody is asked
            assert len(mock.asked) == fault.calls or "breaker_open" in answer.text
        outcomes = metric(url, "vlm_gateway_calls_total", outcome=fault.code or fault.outcome or "")
    assert outcomes == len(QUESTIONS)


def check(answer: httpx.Response, fault: Fault, content: str) -> None:
    told = answer.json()
    assert answer.status_code == fault.status
    if fault.code is None:
        assert (told["outcome"], told[content]) == (fault.outcome, None)
        return
    assert told["error"]["code"] == fault.code
    # five connections refused in a row open the breaker, which is the same outcome
    assert told["error"]["details"].get("reason") in (fault.reason, "breaker_open")
    assert "Traceback" not in answer.text
    assert "sign in" not in answer.text.lower()


def test_empty_choices_are_an_answer_that_can_t_be_read(serve: Serve, mock: OpenAiMock) -> None:
    mock.will(EMPTY_CHOICES)
    assert post(gateway(serve, mock.url), "/v1/floor-count", floors_body()).json()["outcome"] == "unreadable"


def test_a_short_retry_after_is_waited_for_and_the_answer_is_an_answer(serve: Serve, mock: OpenAiMock) -> None:
    mock.will(status(429, retry_after="0.4"), says('{"floors": 3}'))
    answer = post(gateway(serve, mock.url), "/v1/floor-count", floors_body()).json()
    assert (answer["outcome"], answer["floors"], answer["attempts"]) == ("answered", 3, 2)
    assert mock.asked[1].at_s - mock.asked[0].at_s >= 0.4


def test_a_long_retry_after_is_told_to_the_caller(serve: Serve, mock: OpenAiMock) -> None:
    mock.will(status(429, retry_after="90"))
    answer = post(gateway(serve, mock.url), "/v1/floor-count", floors_body())
    assert answer.headers["Retry-After"] == "90"


def test_only_answers_are_kept(serve: Serve, mock: OpenAiMock, tmp_path: Any) -> None:
    url = serve(build({"m": chat_backend(mock)}, cache=sqlite_cache(tmp_path)).app)
    mock.will(says("hm"), says("hm"), says("I can't help with that."), status(400), says('{"floors": 3}'))
    told = [post(url, "/v1/floor-count", floors_body()) for _ in range(5)]
    assert [answer.headers.get("x-cache") for answer in told] == ["miss", "miss", None, "miss", "hit"]
