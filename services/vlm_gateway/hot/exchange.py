"""One chat: its request as it comes in, its answer as it goes out, and what became of it."""

import asyncio
import time
from collections.abc import Iterable
from typing import ClassVar, Protocol

from fastapi.responses import Response
from uvicorn.protocols.http.flow_control import FlowControl
from uvicorn.protocols.http.httptools_impl import STATUS_LINE
from uvicorn.server import ServerState

from contracts.vlm_gateway import CacheResult
from service_kit.errors import ServiceError
from service_kit.requests import EXPOSED, Origins
from service_kit.running_loop import running_loop
from services.vlm_gateway.hot.answers import event_of, rendered, too_large
from services.vlm_gateway.hot.deadline import Deadline, caller_left
from services.vlm_gateway.hot.head import Head, Header, head_of
from services.vlm_gateway.hot.routes import Route
from services.vlm_gateway.keys import ANYBODY, Key
from services.vlm_gateway.tracking import NO_SPAN, Span, Tracer
from services.vlm_gateway.upstream.replies import Spent

_CHUNKED: tuple[Header, ...] = ((b"transfer-encoding", b"chunked"),)
_EXPOSE = b"access-control-expose-headers: " + ", ".join(EXPOSED).encode() + b"\r\nvary: origin\r\n"


class Line(Protocol):
    """The connection that a exchange came on, as uvicorn keeps it."""

    transport: asyncio.Transport
    flow: FlowControl
    server_state: ServerState

    def on_response_complete(self) -> None: ...


class Exchange:
    """`takes_chunks`: the caller knows chunked answers (HTTP/1.1); others' streams end with the connection.
    `size` is how many bytes of the body have come, `status` and `sent` (bytes of the answer) what its caller saw.
    To its connection it is a cycle of uvicorn's: `keep_alive`, `disconnected`, `response_complete` and `message_event`
    are what is looked at there."""

    message_event: ClassVar[asyncio.Event] = asyncio.Event()  # nobody waits for it

    def __init__(
        self,
        line: Line,
        route: Route,
        headers: list[Header],
        keep_alive: bool,
        takes_chunks: bool,
        expects_100: bool,
        max_body_bytes: int,
    ) -> None:
        self._line = line
        self.route = route
        self.adapter = None if route.adapter is None else route.adapter()
        self._headers = headers
        self._takes_chunks = takes_chunks
        self._expects_100 = expects_100
        self._max_body_bytes = max_body_bytes
        self._began = time.perf_counter()
        self._pieces: list[bytes] = []
        self._waiter: asyncio.Future[None] | None = None
        self.size = 0
        self.body_is_whole = False
        self.keep_alive = keep_alive
        self.disconnected = False
        self.response_complete = False
        self.key: Key = ANYBODY
        self.alias = ""
        self.usd: float | None = None
        self.request_id = b""
        self.trace: bytes | None = None
        self._span: Span = NO_SPAN
        self.outcome = "gone"
        self.cache: CacheResult = "off"
        self.status = 499
        self.sent = 0
        self.allowed_origin: bytes | None = None
        self.response_started = False

    @property
    def head(self) -> Head:
        return head_of(self._headers)

    def begin(self, head: Head, tracer: Tracer) -> None:
        """Which request it is; its span begins."""
        self.request_id = head.request_id
        self._span = tracer.request(head.trace, head.request_id)
        self.trace = self._span.traceparent or head.trace

    def end_span(self) -> None:
        if self._span is NO_SPAN:
            return
        facts = {"http.response.status_code": self.status, "logisticsvln.outcome": self.outcome}
        if self.status >= 500:
            facts["error.type"] = self.outcome
        self._span.end(**facts)

    def took_s(self) -> float:
        return time.perf_counter() - self._began

    def facts(self, took_s: float) -> dict[str, str | int | float | None]:
        """What the log says of it: names and numbers only."""
        return {
            "status": self.status,
            "outcome": self.outcome,
            "model": self.alias,
            "key": self.key.name,
            "cache": self.cache,
            "ms": round(took_s * 1000, 2),
            "answer_bytes": self.sent,
            "request_id": self.request_id.decode("latin-1"),
        }

    # -- what the connection tells

    def begins(self, task: asyncio.Task[None]) -> None:
        """It is this task that serves the exchange."""
        self.deadline = Deadline(task)

    def came(self, piece: bytes) -> None:
        """A piece of the body; of one that is too large, or answered already, no more is kept."""
        if self.size <= self._max_body_bytes and not self.response_complete:
            self._pieces.append(piece)
            self.size += len(piece)
            if self.size > self._max_body_bytes:
                self._pieces.clear()
                self._wake()

    def came_whole(self) -> None:
        self.body_is_whole = True
        self._wake()

    def left(self) -> None:
        """The caller is gone."""
        self.disconnected = True
        if not self.response_complete:
            self.deadline.end(caller_left())

    def _wake(self) -> None:
        if self._waiter is not None and not self._waiter.done():
            self._waiter.set_result(None)

    # -- what the frontend asks for

    async def body(self) -> bytes:
        """All of it. Raises ServiceError where it is over its bound."""
        if not self.body_is_whole and self.size <= self._max_body_bytes:
            if self._expects_100:
                self._expects_100 = False
                self._line.transport.write(b"HTTP/1.1 100 Continue\r\n\r\n")
            self._waiter = running_loop().create_future()
            await self._waiter
        if self.size > self._max_body_bytes:
            raise too_large(self._max_body_bytes)
        pieces, self._pieces = self._pieces, []
        return pieces[0] if len(pieces) == 1 else b"".join(pieces)

    def answer(self, body: bytes, kind: bytes, outcome: str = "answered") -> None:
        """The whole answer."""
        if self.adapter is not None:
            body = self.adapter.answer(body)
        self._write_whole(body, kind)
        self.outcome = outcome
        self._complete()

    def replay(self, events: bytes, kind: bytes) -> None:
        """A stream that is known from beginning to end."""
        if self.adapter is not None:
            events = self.adapter.piece(events) + self.adapter.end(Spent())
        self._write_whole(events, kind)
        self.outcome = "answered"
        self._complete()

    def _write_whole(self, body: bytes, kind: bytes) -> None:
        length = str(len(body)).encode()
        headers = ((b"content-type", kind), (b"content-length", length), (b"x-cache", self.cache.encode()))
        self._write(self._head(200, headers) + body)
        self.sent = len(body)

    def fail(self, error: ServiceError) -> None:
        """An error: the answer, or where a stream has begun its last event."""
        name = self.request_id.decode("latin-1")
        if not self.response_started:
            self._tell(rendered(error) if self.adapter is None else self.adapter.error(error, name))
        elif not self.response_complete:
            body = event_of(error) if self.adapter is None else self.adapter.last(error, name)
            self._write_last(body)
            self._complete()

    def _tell(self, answer: Response) -> None:
        self._write(self._head(answer.status_code, answer.raw_headers) + answer.body)
        self._complete()

    async def piece(self, body: bytes, kind: bytes) -> None:
        """A piece of a streamed answer, once the caller has room for it."""
        if self.adapter is not None and not (body := self.adapter.piece(body)):
            return
        if not self.response_started:
            headers = ((b"content-type", kind), (b"cache-control", b"no-store"), (b"x-cache", self.cache.encode()))
            self._write(self._head(200, (*headers, *_CHUNKED) if self._takes_chunks else headers))
        if self._line.flow.write_paused:
            await self._line.flow.drain()
        self.sent += len(body)
        self._write(_chunk(body) if self._takes_chunks else body)

    def end(self, outcome: str, used: Spent) -> None:
        """The end of a streamed answer."""
        self.outcome = outcome
        self._write_last(b"" if self.adapter is None else self.adapter.end(used))
        self._complete()

    def _write_last(self, body: bytes) -> None:
        if self._takes_chunks:
            body = (_chunk(body) if body else b"") + b"0\r\n\r\n"
        self._write(body)

    def close(self) -> None:
        """Nothing follows: what has no end by now is broken off."""
        self.deadline.unlimited()
        self._pieces.clear()
        if not self.response_complete:
            self.response_complete = True
            self._line.transport.close()

    def from_page(self, head: Head, origins: Origins) -> None:
        """The caller is a web page. Raises UnsupportedMedia where it may not send this."""
        origin = (head.origin or b"").decode("latin-1")
        if origins.names(origin):
            self.allowed_origin = head.origin
        kind, host = (head.kind or b"").decode("latin-1"), (head.host or b"").decode("latin-1")
        origins.check(kind, origin, host)

    def _head(self, status: int, headers: Iterable[Header]) -> bytes:
        self.response_started, self.status = True, status
        if self._expects_100 and not self.size:
            self.keep_alive = False  # the caller may leave its body out, and nobody could tell
        parts = [STATUS_LINE[status], _every.lines(self._line.server_state.default_headers)]
        for header in headers:
            parts.append(b"%s: %s\r\n" % header)
        parts.append(self._identity())
        if self.allowed_origin is not None:
            parts += (b"access-control-allow-origin: ", self.allowed_origin, b"\r\n", _EXPOSE)
        parts.append(b"\r\n" if self.keep_alive else b"connection: close\r\n\r\n")
        return b"".join(parts)

    def _identity(self) -> bytes:
        """Header lines: which request it was, who answers it, what it cost, and what is left of the key's rates."""
        lines = b"x-request-id: %s\r\n%s" % (self.request_id, self.key.rates()) if self.request_id else b""
        if self.usd is not None:
            lines += b"x-cost-usd: %.9f\r\n" % self.usd
        return b"%sx-model: %s\r\n" % (lines, self.alias.encode()) if self.alias else lines

    def _write(self, data: bytes) -> None:
        if not self.disconnected:
            self._line.transport.write(data)

    def _complete(self) -> None:
        self.response_complete = True
        if not self.keep_alive:
            self._line.transport.close()
        self._line.on_response_complete()


class _EveryAnswer:
    """The header lines of every answer, made anew when uvicorn has new ones: once a second, for the date."""

    def __init__(self) -> None:
        self._headers: list[Header] = []
        self._lines = b""

    def lines(self, headers: list[Header]) -> bytes:
        if headers is not self._headers:
            self._headers = headers
            self._lines = b"".join(b"%s: %s\r\n" % header for header in headers)
        return self._lines


_every = _EveryAnswer()


def _chunk(body: bytes) -> bytes:
    return b"%x\r\n%s\r\n" % (len(body), body)
