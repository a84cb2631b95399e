"""A model server that answers as vLLM does, by what it is asked: words, a tool's call and its result, a JSON schema, a
picture, a stream that never ends. It is strict where strict servers are: unknown fields of messages are refused."""

import asyncio
import base64
import json
from typing import Any

from aiohttp import web

from tests.services.vlm_gateway.openai_mock import Behaviour

READING = '{"floor": 4, "object": "green flower pot"}'
PRODUCT = '{"a": 6, "b": 7}'
KNOWN = {"role", "content", "name", "tool_calls", "tool_call_id"}
USAGE = {"prompt_tokens": 12, "completion_tokens": 5, "total_tokens": 17}


def answers() -> Behaviour:
    """To be given to `OpenAiMock.will`."""
    return _answer


async def _answer(request: web.Request, body: dict[str, Any]) -> web.StreamResponse:
    for message in body["messages"]:
        if unknown := set(message) - KNOWN:
            told = {"error": {"message": f"unexpected {sorted(unknown)}", "type": "BadRequestError", "code": 400}}
            return web.json_response(told, status=400)
    message = _message(body)
    if body.get("stream"):
        return await _streamed(request, body, message)
    whole = {
        "role": "assistant", "content": None, "refusal": None, "annotations": None, "audio": None,
        "function_call": None, "tool_calls": [], "reasoning": None, **message,
    }  # fmt: skip
    return web.json_response({**_envelope("chat.completion"), "usage": USAGE, "choices": [_choice(message=whole)]})


def _message(body: dict[str, Any]) -> dict[str, Any]:
    last = body["messages"][-1]
    tools = [tool["function"]["name"] for tool in body.get("tools") or []]
    if last["role"] == "tool":
        tools = [name for name in tools if name != "product"]
    if tools:
        name = "product" if "product" in tools else tools[0]
        arguments = PRODUCT if name == "product" else READING
        call = {"id": "call_1", "type": "function", "function": {"name": name, "arguments": arguments}}
        return {"content": None, "tool_calls": [call], "reasoning": "a tool knows"}
    if last["role"] == "tool":
        return {"content": f"the product is {last['content']}"}
    if (body.get("response_format") or {}).get("type") in ("json_schema", "json_object"):
        return {"content": READING}
    if isinstance(last["content"], list):
        pictures = [part["image_url"]["url"] for part in last["content"] if part["type"] == "image_url"]
        if pictures:
            return {"content": f"a picture of {len(base64.b64decode(pictures[0].partition(',')[2]))} bytes"}
    return {"content": "hello over there"}


async def _streamed(request: web.Request, body: dict[str, Any], message: dict[str, Any]) -> web.StreamResponse:
    response = web.StreamResponse(headers={"Content-Type": "text/event-stream; charset=utf-8"})
    await response.prepare(request)

    async def event(**fields: Any) -> None:
        data = {**_envelope("chat.completion.chunk"), **fields}
        await response.write(b"data: " + json.dumps(data).encode() + b"\n\n")

    await event(choices=[_choice(delta={"role": "assistant", "content": ""})])
    while "for ever" in str(body["messages"][-1]["content"]):
        await event(choices=[_choice(delta={"content": "on and "})])
        await asyncio.sleep(0.02)
    for call in message.get("tool_calls", []):
        name, arguments = call["function"]["name"], call["function"]["arguments"]
        first = {**call, "index": 0, "function": {"name": name, "arguments": ""}}
        await event(choices=[_choice(delta={"tool_calls": [first]})])
        for at in range(0, len(arguments), 5):
            piece = {"index": 0, "function": {"arguments": arguments[at : at + 5]}}
            await event(choices=[_choice(delta={"tool_calls": [piece]})])
    for word in (message["content"] or "").split(" ") if message["content"] else []:
        await event(choices=[_choice(delta={"content": word + " "})])
    await event(choices=[_choice(delta={}, finish_reason="tool_calls" if message.get("tool_calls") else "stop")])
    if (body.get("stream_options") or {}).get("include_usage"):
        await event(choices=[], usage=USAGE)
    await response.write(b"data: [DONE]\n\n")
    return response


def _envelope(kind: str) -> dict[str, Any]:
    return {"id": "chatcmpl-1", "object": kind, "created": 1_700_000_000, "model": "maker/model-1"}


def _choice(**fields: Any) -> dict[str, Any]:
    called = fields.get("message", {}).get("tool_calls")
    finish = ("tool_calls" if called else "stop") if "message" in fields else None
    return {"index": 0, "logprobs": None, "finish_reason": finish, **fields}
