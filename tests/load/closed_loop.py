"""A closed loop of chats over kept connections, light enough not to be what is measured.

Every connection sends its next request as soon as the last one is answered. Requests are sent as bytes made before, but
for a number that makes each of them different.
"""

import asyncio
import itertools
import sys
import time
from collections.abc import Sequence
from typing import NamedTuple, cast

import uvloop

_CHUNKED = sys.maxsize
_LAST_CHUNK = b"\r\n0\r\n\r\n"


class Body(NamedTuple):
    """A request's body round a place for what makes it unique; `unique` False sends the same bytes every time."""

    before: bytes
    after: bytes
    unique: bool = True


class Took(NamedTuple):
    """Latencies in seconds of the requests answered within the time, how many were no 200, and that time."""

    latencies_s: Sequence[float]
    failed: int
    wall_s: float


class _Connection(asyncio.Protocol):
    def __init__(self, loop: "_Loop") -> None:
        self._loop = loop
        self._received = b""
        self._want = -1
        self._left = False

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.Transport, transport)
        self._next()

    def _next(self) -> None:
        self._received, self._want = b"", -1
        self._sent_at = time.perf_counter()
        self._transport.writelines(self._loop.request())

    def data_received(self, data: bytes) -> None:
        self._received += data
        if self._want < 0:
            end = self._received.find(b"\r\n\r\n")
            if end < 0:
                return
            head = self._received[:end].lower()
            at = head.find(b"content-length:")
            self._want = _CHUNKED if at < 0 else end + 4 + int(head[at + 15 :].split(b"\r\n", 1)[0])
        whole = self._received.endswith(_LAST_CHUNK) if self._want == _CHUNKED else len(self._received) >= self._want
        if whole:
            now = time.perf_counter()
            self._loop.answered(now - self._sent_at, self._received.startswith(b"HTTP/1.1 200"))
            if now < self._loop.until:
                self._next()
            else:
                self._leave()

    def connection_lost(self, error: Exception | None) -> None:
        if not self._left:
            self._loop.answered(0.0, False)
            self._loop.gone()
            self._left = True

    def _leave(self) -> None:
        self._left = True
        self._transport.abort()
        self._loop.gone()


class _Loop:
    def __init__(self, url: str, key: str, body: Body, connections: int, seconds: float, run: str) -> None:
        host, port = url.removeprefix("http://").split(":")
        self._host, self._port = host, int(port)
        self._body = body
        self._connections = connections
        self._seconds = seconds
        self._numbers = itertools.count()
        self._run = run
        lines = [f"POST /v1/chat/completions HTTP/1.1\r\nhost: {host}\r\nauthorization: Bearer {key}"]
        lines += ["content-type: application/json", "content-length: "]
        self._head = "\r\n".join(lines).encode()
        self._latencies: list[float] = []
        self._failed = 0
        self.until = 0.0

    def request(self) -> list[bytes]:
        nonce = f"{self._run}{next(self._numbers)}".encode() if self._body.unique else b"same"
        length = len(self._body.before) + len(nonce) + len(self._body.after)
        head = self._head + str(length).encode() + b"\r\n\r\n"
        return [head, self._body.before, nonce, self._body.after]

    def answered(self, latency_s: float, good: bool) -> None:
        self._latencies.append(latency_s)
        self._failed += not good

    def gone(self) -> None:
        self._open -= 1
        if self._open == 0 and not self._done.done():
            self._done.set_result(None)

    async def go(self) -> Took:
        loop = asyncio.get_running_loop()
        self._open = self._connections
        self._done = loop.create_future()
        started = time.perf_counter()
        self.until = started + self._seconds
        for _ in range(self._connections):
            await loop.create_connection(lambda: _Connection(self), self._host, self._port)
        await asyncio.wait_for(self._done, self._seconds + 60)
        return Took(self._latencies, self._failed, time.perf_counter() - started)


def drive(url: str, key: str, body: Body, connections: int, seconds: float, run: str) -> Took:
    """Chats at `url` for so long; `run` goes into every unique body."""
    return uvloop.run(_Loop(url, key, body, connections, seconds, run).go())
