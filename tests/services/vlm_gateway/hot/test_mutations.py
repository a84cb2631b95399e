"""Requests and replies with something of them exchanged for something else: whatever it is, it is taken or refused."""

import copy
import json
import random
from collections.abc import Iterator
from typing import Any

import pytest

from service_kit.errors import BadQuestion
from services.vlm_gateway.anthropic.answer import message_of
from services.vlm_gateway.anthropic.request import chat_of
from services.vlm_gateway.config import ChatLimits
from services.vlm_gateway.errors import ModelError
from services.vlm_gateway.hot.request import part_types
from services.vlm_gateway.hot.rewriting import rewritten
from services.vlm_gateway.hot.scan import read, scan
from services.vlm_gateway.upstream.accepted import accepted
from services.vlm_gateway.upstream.replies import ReplyReader
from tests.services.vlm_gateway.anthropic.test_messages import PICTURE, TOOL
from tests.services.vlm_gateway.kit import chat_settings, picture_base64
from tests.services.vlm_gateway.openai_mock import completion

TIMES = 400
OTHER: tuple[Any, ...] = (
    *(None, True, 0, -1, 0.5, 1e308, 10**30, "", "x", "data:,", "\u0000", [], {}, [[]], [{}], [None], ["user"]),
    *({"type": "text"}, {"type": "image_url"}, {"url": "x"}, {"error": {"code": []}}, {"role": "user"}),
)
CALL = {"id": "1", "type": "function", "function": {"name": "f", "arguments": '{"a": 1}'}}
PARTS = [
    {"type": "text", "text": "t"},
    {"type": "image_url", "image_url": {"url": f"data:image/jpeg;base64,{picture_base64()}", "detail": "low"}},
]
CHAT = {
    "model": "m",
    "temperature": 0,
    "max_tokens": 5,
    "stream": True,
    "stream_options": {"include_usage": True},
    "tools": [{"type": "function", "function": {"name": "f", "parameters": {}}}],
    "messages": [
        {"role": "developer", "content": "d"},
        {"role": "user", "content": PARTS},
        {"role": "assistant", "content": None, "tool_calls": [CALL], "reasoning": "r"},
        {"role": "tool", "tool_call_id": "1", "content": "x"},
    ],
}
MESSAGE = {
    "model": "m",
    "system": [{"type": "text", "text": "s"}],
    "tools": [TOOL],
    "tool_choice": {"type": "tool", "name": "product"},
    "messages": [
        {"role": "user", "content": [{"type": "text", "text": "a"}, PICTURE]},
        {"role": "assistant", "content": [{"type": "tool_use", "id": "1", "name": "product", "input": {"a": 1}}]},
        {"role": "user", "content": [{"type": "tool_result", "tool_use_id": "1", "content": [PICTURE]}]},
    ],
}
REPLY = completion("hello", tool_calls=[CALL], refusal=None)


def places(node: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    inner = node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ()
    for name, value in inner:
        yield (*path, name)
        yield from places(value, (*path, name))


def mutated(node: dict[str, Any], chance: random.Random) -> dict[str, Any]:
    """With one to three things in it left out or exchanged."""
    node = copy.deepcopy(node)
    for _ in range(chance.randint(1, 3)):
        *above, last = chance.choice(list(places(node)) or [("model",)])
        owner: Any = node
        for name in above:
            owner = owner[name]
        if chance.random() < 0.2 and node:
            del owner[last]
        else:
            owner[last] = copy.deepcopy(chance.choice(OTHER))
    return node


@pytest.mark.parametrize("anthropics", [False, True])
def test_a_request_is_taken_in_every_server_s_words_or_refused(anthropics: bool) -> None:
    chance = random.Random(7)
    presets = (("vllm", "qwen2.5-vl"), ("openai-compatible", "generic-vision"))
    targets = [accepted(chat_settings(None, server=server, preset=preset), b'"x"') for server, preset in presets]
    taken = 0
    for _ in range(TIMES):
        asked = mutated(MESSAGE if anthropics else CHAT, chance)
        raw = json.dumps(asked).encode()
        try:
            scanned, chat = read(scan(json.dumps(chat_of(raw)).encode() if anthropics else raw), ChatLimits())
        except BadQuestion:
            continue
        taken += 1
        assert isinstance(part_types(chat), frozenset)
        for target in targets:
            assert json.loads(b"".join(bytes(piece) for piece in rewritten(scanned, chat, target)))["model"] == "x"
    assert TIMES / 20 < taken < TIMES


def test_a_reply_is_read_as_a_chat_and_as_a_message_or_is_the_model_s_error() -> None:
    chance, reader, read_ones = random.Random(7), ReplyReader("m", "sk-secret"), 0
    for _ in range(TIMES):
        body = json.dumps(mutated(REPLY, chance)).encode()
        try:
            said = reader.said("openai", body, {})
        except ModelError:
            continue
        assert 0 <= min(said.tokens) <= max(said.tokens) < 10**10
        if said.message is not None:
            read_ones += 1
            assert message_of(body, "m")["type"] == "message"
    assert TIMES / 20 < read_ones < TIMES
