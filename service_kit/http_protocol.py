"""HTTP/1.1 as every service speaks it: uvicorn's connection on httptools, with deadlines and bounds of our own.

What uvicorn leaves open and this closes:
  an offer to change the protocol (h2c: the JDK's client, `curl --http2`) is ignored, as RFC 9110 section 7.8 allows;
  uvicorn loses the body of such a request
  a head or a body that never ends, a caller that stops reading its answer, more connections or more bytes than there
  is room for: see http_limits.py

uvicorn's classes used here are private to it: pyproject.toml pins its version exactly, and
tests/service_kit/test_http_protocol.py names every attribute that is relied on.
"""

import asyncio
from collections import deque
from collections.abc import Mapping
from typing import Any, Literal, cast

import httptools
from uvicorn.protocols.http.httptools_impl import STATUS_LINE, HttpToolsProtocol

from contracts.errors import ErrorBody, ErrorDetail
from service_kit.auth import OPEN_PATHS
from service_kit.errors import ServiceError
from service_kit.http_head import without_upgrade
from service_kit.http_limits import MAX_FRAMING_BYTES, Framing, OpenConnections, unread_bytes

LEAST_BYTES_PER_S = 1024
"""A caller that takes less of an answer counts as one that has stopped reading."""
MAX_DROPPED_BYTES = 64 * 1024 * 1024
"""So much of a body is read and dropped after its request was refused, so that the caller sees why."""
_OPEN_PATHS = frozenset(path.encode() for path in OPEN_PATHS)

Stage = Literal["none", "head", "body", "idle"]
"""What a connection's caller is waited for with: nothing, a request's head, its body, or a request at all."""


class ServiceProtocol(HttpToolsProtocol):
    """One connection of a caller."""

    def __init__(self, connections: OpenConnections, **uvicorns: Any) -> None:
        super().__init__(**uvicorns)
        self._all = connections
        self._limits = limits = connections.limits
        self._within_s = {"head": limits.head_within_s, "body": limits.body_within_s, "idle": limits.keep_alive_s}
        self._stage: Stage = "none"
        self._watched: Stage = "none"
        self._due = 0.0
        self._timer: asyncio.TimerHandle | None = None
        self._writing: asyncio.TimerHandle | None = None
        self._unread = 0
        self._bodies: deque[int] = deque()  # bytes held of each request without an answer yet
        self._framing = Framing()
        self._body_bytes = self._dropped = 0
        self._body_at = 0.0

    # -- what the transport tells

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        if not self._all.opened(self):
            self.break_off(503, "too_many_connections", "the server has as many connections as it may; try again later")
            return
        self._watch("head")

    def data_received(self, data: bytes) -> None:
        size = len(data)
        while True:
            try:
                self.parser.feed_data(data)
            except httptools.HttpParserUpgrade as offered:
                if self.parser.get_method() == b"CONNECT":
                    self.break_off(405, "method_not_allowed", "this is no proxy: CONNECT is not taken")
                    return
                data = self._head_without_upgrade() + data[offered.args[0] :]
                continue
            except httptools.HttpParserError:
                self.break_off(400, "bad_request", "this is not a valid HTTP/1.1 request")
                return
            break
        stage = self._stage
        if stage == "none":
            if self._is_idle():
                stage = "head" if self.cycle is None else "idle"  # line breaks between requests: nothing has begun
        elif self._framing.too_much(size, self._body_bytes):
            self.break_off(431, "head_too_large", f"a request's head may have {MAX_FRAMING_BYTES} bytes")
            return
        if stage == "none":
            self._watched = stage
        elif stage != self._watched and not self.transport.is_closing():
            self._watch(stage)

    def connection_lost(self, exc: Exception | None) -> None:
        self._all.closed(self)
        self._all.body_gone(sum(self._bodies))
        self._bodies.clear()
        self._watch("none")
        if self._timer is not None:
            self._timer.cancel()
        self._stop_watching_writes()
        super().connection_lost(exc)

    def pause_writing(self) -> None:
        super().pause_writing()
        self._unread = unread_bytes(self.transport)
        self._writing = self.loop.call_later(self._limits.write_within_s, self._look_at_reader)

    def resume_writing(self) -> None:
        super().resume_writing()
        self._stop_watching_writes()

    # -- what the parser tells

    def on_message_begin(self) -> None:
        self._stage = "head"
        self._framing.came = None
        self._body_bytes = self._dropped = 0
        self._bodies.append(0)
        self.begin_head()

    def begin_head(self) -> None:
        """The head of a request follows."""
        super().on_message_begin()

    def on_headers_complete(self) -> None:
        if self.parser.should_upgrade():
            return  # the same head comes once more, without the offer
        self._stage = "body"
        self._all.busy(self)
        if self._called_by_another_name():
            self.break_off(421, "misdirected", "this server is not called by that name; ALLOWED_HOSTS lists its names")
        else:
            self.on_request()

    def on_request(self) -> None:
        """The head of a request is complete."""
        super().on_headers_complete()

    def on_body(self, body: bytes) -> None:
        size = len(body)
        self._body_bytes += size
        if self._bodies:
            self._bodies[-1] += size
            self._body_at = now = self.loop.time()
            self._all.body_came(self, size, now)
        else:
            self._dropped += size  # of a request that has its answer already
            if self._dropped > MAX_DROPPED_BYTES:
                self.transport.close()
        if not self.transport.is_closing():
            self.take_body(body)

    def take_body(self, body: bytes) -> None:
        """A piece of a request's body."""
        super().on_body(body)

    def on_message_complete(self) -> None:
        if self.parser.should_upgrade():
            self._bodies.pop()
            return
        self._stage = "none"
        if not self.transport.is_closing():
            self.end_body()

    def end_body(self) -> None:
        """The body of a request is through."""
        super().on_message_complete()

    # -- what the answer tells

    def on_response_complete(self) -> None:
        if self._bodies:
            self._all.body_gone(self._bodies.popleft())
        self.server_state.total_requests += 1
        if self.transport.is_closing():
            return
        self.flow.resume_reading()
        if self.pipeline:
            self._start_asgi_task(*self.pipeline.pop())
        else:
            self._all.idle(self)
            if self._stage == "none":
                self._watch("idle")

    # -- what the bounds ask for

    @property
    def body_stands_since(self) -> float | None:
        return self._body_at if self._stage == "body" and self._bodies and self._bodies[-1] else None

    def give_way(self) -> None:
        """Close for somebody else: no request is under way."""
        self.transport.abort()

    def refuse_body(self) -> None:
        message = "the server holds as many bytes of requests as it may; ask again later"
        self.refuse_request(ServiceError(message, code="overloaded", status=503, headers={"Retry-After": "1"}))

    def refuse_request(self, error: ServiceError) -> None:
        """Answer the request whose body is coming in with an error. The rest of the body is read and dropped, so that
        the caller gets to see the answer; only one that was too slow is not waited for."""
        if self._is_idle():
            self.transport.close()  # it was refused before, and goes on sending
        elif error.status == 408 or self.pipeline or self.cycle.response_started:
            self.break_off(error.status, error.code, error.message)
        else:
            self._write_error(error.status, error.code, error.message, error.headers)
            self.cycle.response_complete = self.cycle.disconnected = True
            self.cycle.message_event.set()
            self.on_response_complete()

    def break_off(self, status: int, code: str, message: str) -> None:
        """An error answer where none has begun, and the end of the connection."""
        if self.transport.is_closing():
            return
        if not self._is_idle() and (self.pipeline or self.cycle.response_started):
            self.transport.abort()
            return
        self._write_error(status, code, message, {"connection": "close"})
        self.transport.close()

    def _write_error(self, status: int, code: str, message: str, headers: Mapping[str, str]) -> None:
        body = ErrorBody(error=ErrorDetail(code=code, message=message)).model_dump_json().encode()
        head = [STATUS_LINE[status], b"content-type: application/json\r\n"]
        head += [name + b": " + value + b"\r\n" for name, value in self.server_state.default_headers]
        head += [f"{name}: {value}\r\n".encode("latin-1") for name, value in headers.items()]
        head.append(b"content-length: %d\r\n\r\n" % len(body))
        self.transport.write(b"".join(head) + body)

    def _called_by_another_name(self) -> bool:
        """Whoever asks for health only, as platforms do, may call it anything."""
        hosts = self._all.hosts
        if hosts is None:
            return False
        return not (hosts.are_named_in(self.headers) or self.url.partition(b"?")[0] in _OPEN_PATHS)

    # -- watching

    def _is_idle(self) -> bool:
        return not self.pipeline and (self.cycle is None or self.cycle.response_complete)

    def _watch(self, stage: Stage) -> None:
        """Give what is waited for its time; this replaces an earlier limit. A timer is kept until it is due, and then
        looks what is waited for by now: most waits are over long before, and timers are dear."""
        self._watched = stage
        if stage == "none":
            return
        self._due = self.loop.time() + self._within_s[stage]
        if self._timer is not None and self._timer.when() <= self._due:
            return
        self._remind()

    def _remind(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
        self._timer = self.loop.call_at(self._due, self._look)

    def _look(self) -> None:
        self._timer = None
        if self._watched == "none" or self.transport.is_closing():
            return
        if self.loop.time() < self._due:
            self._remind()
        else:
            self._late()

    def _late(self) -> None:
        if self._watched == "idle":
            if unread_bytes(self.transport):
                self.transport.abort()  # the last answer was never read to its end
            else:
                self.transport.close()
        elif self.flow.read_paused or (self._watched == "head" and not self._is_idle()):
            self._watch(self._watched)  # it is us who are not reading, or not done with what came before
        elif self._watched == "body":
            self.refuse_request(ServiceError("the body did not come in time", code="slow_body", status=408))
        else:
            self.transport.close()  # nothing was asked yet, so nothing is answered

    def _look_at_reader(self) -> None:
        unread = unread_bytes(self.transport)
        if self._unread - unread < self._limits.write_within_s * LEAST_BYTES_PER_S:
            self._writing = None
            self.transport.abort()
            return
        self._unread = unread
        self._writing = self.loop.call_later(self._limits.write_within_s, self._look_at_reader)

    def _stop_watching_writes(self) -> None:
        if self._writing is not None:
            self._writing.cancel()
            self._writing = None

    def _head_without_upgrade(self) -> bytes:
        """The head that was just read, its offer to change the protocol taken out; a new parser is to read it."""
        version = self.parser.get_http_version().encode()
        first = self.parser.get_method() + b" " + self.url + b" HTTP/" + version
        self.parser = httptools.HttpRequestParser(self)
        cast(Any, self.parser).set_dangerous_leniencies(lenient_data_after_close=True)
        return without_upgrade(first, self.headers)
