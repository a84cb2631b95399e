"""One request on its way: what its head says, what became of it, and the form in which answers are kept."""

import re
import time
from typing import NamedTuple, Self

from starlette.types import Scope, Send

from contracts.vlm_gateway import CacheResult
from service_kit.errors import BadQuestion
from services.vlm_gateway.keys import ANYBODY, Key

_TRACEPARENT = re.compile(rb"00-[0-9a-f]{32}-[0-9a-f]{16}-[0-9a-f]{2}")
_CACHE_HEADER = {b"on": True, b"off": False}


class Head(NamedTuple):
    """What of a request's headers counts. `cache` is None where the caller leaves it to us."""

    authorization: bytes | None
    length: int
    cache_said: bytes | None
    timeout_said: bytes | None
    trace: bytes | None

    @property
    def cache(self) -> bool | None:
        """Raises BadQuestion."""
        if self.cache_said is None:
            return None
        if self.cache_said not in _CACHE_HEADER:
            raise BadQuestion("x-cache: say on or off, or leave it out")
        return _CACHE_HEADER[self.cache_said]

    @property
    def timeout_s(self) -> float | None:
        """Raises BadQuestion."""
        if self.timeout_said is None:
            return None
        try:
            limit_s = float(self.timeout_said)
        except ValueError:
            limit_s = 0.0
        if not 0.001 <= limit_s <= 3600.0:
            said = self.timeout_said[:20].decode("latin-1")
            raise BadQuestion(f"x-timeout-s: {said!r} is no number of seconds from 0.001 to 3600")
        return limit_s


def head_of(scope: Scope) -> Head:
    """What is written wrongly is found when it is used."""
    found = dict(scope["headers"])
    length = found.get(b"content-length", b"0")
    trace = found.get(b"traceparent")
    return Head(
        found.get(b"authorization"),
        int(length) if length.isdigit() else 0,
        found.get(b"x-cache"),
        found.get(b"x-timeout-s"),
        trace if trace is not None and _TRACEPARENT.fullmatch(trace) else None,
    )


class Visit:
    """What becomes of one request. `status` and `sent` (bytes of the answer) are what its caller saw."""

    def __init__(self, send: Send) -> None:
        self._send = send
        self._began = time.perf_counter()
        self.key: Key = ANYBODY
        self.alias = ""
        self.outcome = "gone"
        self.cache: CacheResult = "off"
        self.status = 499
        self.sent = 0
        self.started = False

    def took_s(self) -> float:
        return time.perf_counter() - self._began

    async def answer(self, body: bytes, kind: bytes, alias: str | None = None) -> None:
        """The whole answer; `alias` where another model than the one that was asked may have given it."""
        if alias is not None:
            self.alias = alias
        headers = [
            (b"content-type", kind),
            (b"content-length", str(len(body)).encode()),
            (b"x-cache", self.cache.encode()),
        ]
        self.started, self.status, self.sent = True, 200, len(body)
        await self._send({"type": "http.response.start", "status": 200, "headers": headers})
        await self._send({"type": "http.response.body", "body": body})
        self.outcome = "answered"

    async def piece(self, body: bytes, kind: bytes) -> None:
        """A piece of a streamed answer."""
        if not self.started:
            self.started, self.status = True, 200
            headers = [(b"content-type", kind), (b"cache-control", b"no-store"), (b"x-cache", self.cache.encode())]
            await self._send({"type": "http.response.start", "status": 200, "headers": headers})
        self.sent += len(body)
        await self._send({"type": "http.response.body", "body": body, "more_body": True})

    async def end(self) -> None:
        """The end of a streamed answer."""
        self.outcome = "answered"
        await self._send({"type": "http.response.body", "body": b""})


class Stored(NamedTuple):
    """An answer as it is kept: a line with its kind and its model's alias, then its bytes."""

    alias: str
    stream: bool
    body: bytes

    def written(self) -> bytes:
        return f"{'sse' if self.stream else 'json'} {self.alias}\n".encode() + self.body

    @classmethod
    def read(cls, value: bytes) -> Self | None:
        """None where the bytes are none of ours."""
        line, separator, body = value.partition(b"\n")
        kind, _, alias = line.partition(b" ")
        if not separator or kind not in (b"sse", b"json") or not alias or len(alias) > 80:
            return None
        return cls(alias.decode("ascii", "replace"), kind == b"sse", body)
