"""llm_parser, the gateway and a model's server, three processes' worth of real HTTP: every fault of the server ends in
its typed outcome at the parser's door."""

from collections.abc import Iterator
from functools import cache
from typing import Any

import pytest

from services.llm_parser import bootstrap as parser_bootstrap
from services.llm_parser.bootstrap import bootstrap
from services.llm_parser.reader.model import ReaderModel
from services.llm_parser.settings import LlmParserSettings
from tests.conftest import Serve
from tests.services.vlm_gateway.faults import EMPTY_CHOICES, FAULTS, Fault, suffering
from tests.services.vlm_gateway.kit import build, chat_backend, post
from tests.services.vlm_gateway.openai_mock import OpenAiMock, says

REQUEST = "Hi, I'm on the seventh floor and there's a green flower pot at my window."


@pytest.fixture(scope="module", autouse=True)
def one_reader() -> Iterator[None]:
    """The parsers of all these tests share the weights: 150 MB of them are enough."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(parser_bootstrap, "ReaderModel", cache(ReaderModel))
        yield


@pytest.fixture(scope="module")
def running_mock() -> Iterator[OpenAiMock]:
    mock = OpenAiMock().start()
    yield mock
    mock.stop()


def parser(serve: Serve, address: str, deadline_s: float = 15.0) -> str:
    backend = chat_backend(None, base_url=address, timeout_s=deadline_s, preset="deepseek-r1-distill")
    gateway = serve(build({"m": backend}, roles={"parser": "m"}).app)
    return serve(bootstrap(LlmParserSettings.read({"PARSER_BACKEND": "chat", "VLM_GATEWAY_URL": gateway})))


def parse(url: str) -> Any:
    return post(url, "/v1/parse", {"request": REQUEST})


@pytest.mark.parametrize("fault", FAULTS, ids=[fault.name for fault in FAULTS])
def test_a_fault_of_the_model_s_server_ends_in_a_typed_outcome(
    serve: Serve, running_mock: OpenAiMock, fault: Fault
) -> None:
    with suffering(fault, running_mock) as address:
        answer = parse(parser(serve, address, fault.deadline_s))
    told = answer.json()
    assert answer.status_code == fault.status
    if fault.code is None:
        assert (told["outcome"], told["floor"], told["object"]) == (fault.outcome, None, None)
        assert told["missing"] == ["floor", "object"]
    else:
        assert told["error"]["code"] == fault.code


def test_empty_choices_are_no_completion_and_so_no_answer(serve: Serve, running_mock: OpenAiMock) -> None:
    running_mock.will(EMPTY_CHOICES)
    answer = parse(parser(serve, running_mock.url))
    assert (answer.status_code, answer.json()["error"]["code"]) == (503, "model_unreachable")


def test_an_answer_with_things_the_customer_never_said_is_asked_again_and_then_read(
    serve: Serve, running_mock: OpenAiMock
) -> None:
    invented = '<think>ok</think>{"floor": 7, "object": "red kite"}'
    running_mock.will(says(invented), says('<think>right</think>{"floor": 7, "object": "green flower pot"}'))
    told = parse(parser(serve, running_mock.url)).json()
    assert (told["outcome"], told["floor"], told["object"]) == ("answered", 7, "green flower pot")
    running_mock.will(says(invented))
    told = parse(parser(serve, running_mock.url)).json()
    assert (told["outcome"], told["floor"], told["object"]) == ("unreadable", None, None)
    assert len(running_mock.asked) == 2
