"""`python -m tests.load.chat_mock PORT [MS]`: a model server that costs next to nothing, to measure what is in front.

Answers every POST with the same completion, at once or after MS milliseconds, those under `/stream/` with the same
stream, an event a write, and `GET /stats` with how many there were. Prints its port.
"""

import asyncio
import json
import sys
from typing import cast

import uvloop

COMPLETION = {
    "id": "chatcmpl-1",
    "object": "chat.completion",
    "created": 1_700_000_000,
    "model": "mock",
    "choices": [{"index": 0, "message": {"role": "assistant", "content": '{"floors": 3}'}, "finish_reason": "stop"}],
    "usage": {"prompt_tokens": 900, "completion_tokens": 24, "total_tokens": 924},
}


def _reply(body: bytes) -> bytes:
    return b"HTTP/1.1 200 OK\r\ncontent-type: application/json\r\ncontent-length: %d\r\n\r\n" % len(body) + body


REPLY = _reply(json.dumps(COMPLETION).encode())
STREAM_HEAD = b"HTTP/1.1 200 OK\r\ncontent-type: text/event-stream\r\ntransfer-encoding: chunked\r\n\r\n"
STREAM_WORDS = 32


def _chunk(data: bytes) -> bytes:
    return b"%x\r\n%s\r\n" % (len(data), data)


def _event(delta: dict[str, str], finish_reason: str | None = None, usage: dict[str, int] | None = None) -> bytes:
    """As vLLM writes them: without choices where it says what the answer cost."""
    choices = [{"index": 0, "delta": delta, "logprobs": None, "finish_reason": finish_reason}] if usage is None else []
    event = {"id": "chatcmpl-1", "object": "chat.completion.chunk", "created": 1_700_000_000, "model": "mock"}
    event |= {"choices": choices} | ({} if usage is None else {"usage": usage})
    return b"data: " + json.dumps(event, separators=(",", ":")).encode() + b"\n\n"


STREAM = [
    STREAM_HEAD + _chunk(_event({"role": "assistant", "content": ""})),
    *(_chunk(_event({"content": f" word{number}"})) for number in range(STREAM_WORDS)),
    _chunk(_event({}, "stop")),
    _chunk(_event({}, usage={"prompt_tokens": 900, "completion_tokens": STREAM_WORDS, "total_tokens": 932})),
    _chunk(b"data: [DONE]\n\n") + b"0\r\n\r\n",
]


class Mock(asyncio.Protocol):
    """One connection; bodies are counted, not kept."""

    answered = 0
    after_s = 0.0

    def __init__(self) -> None:
        self._head = b""
        self._left = 0
        self._streams = False

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.Transport, transport)

    def data_received(self, data: bytes) -> None:
        while data:
            if self._left:
                taken = min(self._left, len(data))
                self._left -= taken
                data = data[taken:]
                if not self._left:
                    self._answer()
                continue
            self._head += data
            end = self._head.find(b"\r\n\r\n")
            if end < 0:
                return
            head, data, self._head = self._head[:end].lower(), self._head[end + 4 :], b""
            if head.startswith(b"get"):
                self._transport.write(_reply(json.dumps({"answered": Mock.answered}).encode()))
            else:
                at = head.find(b"content-length:")
                self._left = int(head[at + 15 :].split(b"\r\n", 1)[0])
                self._streams = b"/stream/" in head[: head.find(b"\r\n")]

    def _answer(self) -> None:
        Mock.answered += 1
        if self._streams:
            self._stream(0)
        elif self.after_s:
            asyncio.get_running_loop().call_later(self.after_s, self._transport.write, REPLY)
        else:
            self._transport.write(REPLY)

    def _stream(self, at: int) -> None:
        self._transport.write(STREAM[at])
        if at + 1 < len(STREAM):
            asyncio.get_running_loop().call_soon(self._stream, at + 1)


async def main(port: int) -> None:
    server = await asyncio.get_running_loop().create_server(Mock, "127.0.0.1", port, backlog=1024)
    sys.stdout.write(f"{server.sockets[0].getsockname()[1]}\n")
    sys.stdout.flush()
    await server.serve_forever()


if __name__ == "__main__":
    Mock.after_s = float(sys.argv[2]) / 1000 if len(sys.argv) > 2 else 0.0
    uvloop.run(main(int(sys.argv[1])))
