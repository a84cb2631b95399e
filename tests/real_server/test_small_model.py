"""The gateway in front of llama.cpp's own server with a real small model (SmolLM2-135M-Instruct): real words, streams,
a schema, the tokens it counts, its limits."""

import json
from collections.abc import Iterator

import httpx
import openai
import pytest

from tests.conftest import free_port
from tests.real_server.conftest import HERE, Gateway, Running, environment_of, process
from tests.services.vlm_gateway.kit import metric

pytestmark = pytest.mark.real_server
CAPITAL = [{"role": "user", "content": "What is the capital of France?"}]


@pytest.fixture(scope="module")
def smollm2(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    port, log = free_port(), tmp_path_factory.mktemp("smollm2") / "smollm2.log"
    python = str(environment_of("small-model") / "python")
    command = [python, str(HERE / "smollm2_server.py"), str(port)]
    with process(command, f"http://127.0.0.1:{port}/health", log) as started:
        yield Running(f"http://127.0.0.1:{port}/v1", "smollm2", started, log)


@pytest.fixture
def url(smollm2: Running, gateway: Gateway) -> str:
    table = {"backend": "chat", "preset": "generic-text", "server": "llama-cpp", "base_url": smollm2.url}
    lines = [f"{name} = {json.dumps(value)}" for name, value in {**table, "model": smollm2.model}.items()]
    return gateway('[models."HuggingFaceTB/SmolLM2-135M-Instruct"]\n' + "\n".join(lines) + "\n")


@pytest.fixture
def client(url: str) -> Iterator[openai.OpenAI]:
    with openai.OpenAI(base_url=url + "/v1", api_key="none", max_retries=0, timeout=170) as client:
        yield client


MODEL = "HuggingFaceTB/SmolLM2-135M-Instruct"


def test_it_answers_in_words_and_its_tokens_are_counted(client: openai.OpenAI, url: str) -> None:
    answer = client.chat.completions.create(model=MODEL, messages=CAPITAL, max_tokens=12, temperature=0)
    assert len((answer.choices[0].message.content or "").split()) >= 3
    assert answer.usage is not None
    assert metric(url, "vlm_gateway_tokens_total", kind="completion") == answer.usage.completion_tokens


def test_its_stream_says_the_same_and_is_counted_unasked(client: openai.OpenAI, url: str) -> None:
    whole = client.chat.completions.create(model=MODEL, messages=CAPITAL, max_tokens=12, temperature=0)
    counted = metric(url, "vlm_gateway_tokens_total", kind="completion")
    stream = client.chat.completions.create(
        model=MODEL, messages=CAPITAL, max_tokens=12, temperature=0, stream=True, extra_headers={"x-cache": "off"}
    )
    pieces = list(stream)
    said = "".join(piece.choices[0].delta.content or "" for piece in pieces if piece.choices)
    assert said == whole.choices[0].message.content
    assert all(piece.usage is None for piece in pieces)
    assert metric(url, "vlm_gateway_tokens_total", kind="completion") == 2 * counted


def test_it_is_held_to_a_schema(client: openai.OpenAI) -> None:
    properties = {"floor": {"type": "integer"}, "object": {"type": "string"}}
    schema = {"type": "object", "properties": properties, "required": ["floor", "object"]}
    answer = client.chat.completions.create(
        model=MODEL,
        messages=[{"role": "user", "content": "Bring it to floor 4, the window with the green pot. Answer in JSON."}],
        max_tokens=40,
        temperature=0,
        response_format={"type": "json_schema", "json_schema": {"name": "reading", "schema": schema}},
    )
    told = json.loads(answer.choices[0].message.content or "")
    assert set(told) == {"floor", "object"}
    assert isinstance(told["floor"], int)


def test_a_stream_that_is_left_frees_the_model_for_the_next(client: openai.OpenAI, url: str) -> None:
    long = [{"role": "user", "content": "Count from 1 to 1000."}]
    stream = client.chat.completions.create(model=MODEL, messages=long, max_tokens=500, stream=True)  # type: ignore
    next(iter(stream))
    stream.close()
    answer = client.chat.completions.create(model=MODEL, messages=CAPITAL, max_tokens=5, temperature=0)
    assert answer.choices[0].finish_reason == "length"
    assert httpx.get(url + "/v1/status", timeout=60).json()["models"][MODEL]["running"] == 0


def test_a_request_over_its_context_is_the_caller_s_error(client: openai.OpenAI) -> None:
    with pytest.raises(openai.BadRequestError) as refused:
        client.chat.completions.create(model=MODEL, messages=[{"role": "user", "content": "word " * 5000}])
    assert refused.value.status_code == 400
