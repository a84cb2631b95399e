"""A model server that does what the request's words ask for: the worse half of what real ones do, for the soak.

The words are `DEED NUMBER`, such as `stream 12`. Every event of a stream holds one short word, so that the gateway's
estimate of what was relayed is the number of events.
"""

import asyncio
import json
import re
from typing import Any, cast

PROMPT_TOKENS = 17
DEEDS = re.compile(r"^(\w+) (\d+)")
STREAM_HEAD = b"HTTP/1.1 200 OK\r\ncontent-type: text/event-stream\r\ntransfer-encoding: chunked\r\n\r\n"


def usage(completion: int) -> dict[str, int]:
    return {
        "prompt_tokens": PROMPT_TOKENS,
        "completion_tokens": completion,
        "total_tokens": PROMPT_TOKENS + completion,
    }


def whole(words: int) -> bytes:
    message = {"role": "assistant", "content": "word " * words}
    choices = [{"index": 0, "message": message, "finish_reason": "stop"}]
    return json.dumps({"id": "c", "object": "chat.completion", "choices": choices, "usage": usage(words)}).encode()


def event(delta: dict[str, str], finish_reason: str | None = None, **more: object) -> bytes:
    choices = [{"index": 0, "delta": delta, "finish_reason": finish_reason}]
    said = {"id": "c", "object": "chat.completion.chunk", "choices": choices, **more}
    return _chunk(b"data: " + json.dumps(said).encode() + b"\n\n")


def _chunk(data: bytes) -> bytes:
    return b"%x\r\n%s\r\n" % (len(data), data)


def reply(status: str, body: bytes, *more: str) -> bytes:
    lines = [f"HTTP/1.1 {status}", "content-type: application/json", f"content-length: {len(body)}", *more]
    return "\r\n".join(lines).encode() + b"\r\n\r\n" + body


async def serve() -> asyncio.Server:
    """On a free port of the loopback, in the running loop."""
    return await asyncio.start_server(_connection, "127.0.0.1", 0, backlog=1024)


async def _connection(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    try:
        while True:
            async with asyncio.timeout(3.0):  # kept connections end soon, so that those left open can be counted
                head = await reader.readuntil(b"\r\n\r\n")
            length = re.search(rb"content-length: (\d+)", head.lower())
            body = json.loads(await reader.readexactly(int(length[1]))) if length else {}
            await _answer(body, reader, writer)
            await writer.drain()
    except (OSError, asyncio.IncompleteReadError, TimeoutError):
        pass
    finally:
        writer.transport.abort()


async def _answer(body: dict[str, Any], reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    found = DEEDS.match(body["messages"][-1]["content"])
    assert found is not None
    deed, number = found[1], int(found[2])
    if deed == "whole":
        await asyncio.sleep(number / 1000)
        writer.write(reply("200 OK", whole(number)))
    elif deed == "refuse":
        writer.write(reply("400 Bad Request", b'{"error": {"message": "no", "type": "invalid_request_error"}}'))
    elif deed == "busy":
        writer.write(reply("429 Too Many Requests", b'{"error": {"message": "slow"}}', "retry-after: 9"))
    elif deed == "crash":
        writer.write(reply("500 Internal Server Error", b"<html>"))
    elif deed == "reset":
        cast(asyncio.Transport, writer.transport).abort()
    elif deed == "cut":
        writer.write(reply("200 OK", whole(number))[:-20])
        await writer.drain()
        raise ConnectionResetError
    elif deed == "stall":
        await reader.read(1)  # until the gateway gives up
        raise ConnectionResetError
    else:
        await _stream(deed, number, reader, writer)


async def _stream(deed: str, number: int, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    writer.write(STREAM_HEAD + event({"role": "assistant", "content": ""}))
    for at in range(number):
        writer.write(event({"content": f"w{at % 10}"}))
        if deed == "slow" or at % 7 == 0:
            await writer.drain()
            await asyncio.sleep(0.02 if deed == "slow" else 0)
    if deed == "streamcut":
        await writer.drain()
        raise ConnectionResetError
    if deed == "streamstall":
        await writer.drain()
        await reader.read(1)
        raise ConnectionResetError
    if deed == "streamerror":
        writer.write(_chunk(b'data: {"error": {"message": "out of memory", "code": 500}}\n\n') + b"0\r\n\r\n")
        return
    writer.write(event({}, "stop") + event({}, None, usage=usage(number)) + _chunk(b"data: [DONE]\n\n") + b"0\r\n\r\n")
