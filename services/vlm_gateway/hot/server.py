"""Chats and their like straight from the socket and back; everything else goes the framework's way.

uvicorn hands a body on in pieces, each with a message, an event, a copy and a pause of the socket: for a chat with a
picture that takes longer than all that is done about it here. So a chat's body is gathered, and its answer written,
without messages; the rest is the connection that every service has (service_kit/http_protocol.py).
"""

from collections.abc import Coroutine
from typing import Any, Protocol, cast
from urllib.parse import unquote_to_bytes

import httptools
from uvicorn.protocols.http.flow_control import HIGH_WATER_LIMIT
from uvicorn.protocols.http.httptools_impl import RequestResponseCycle

from service_kit.errors import ServiceError
from service_kit.http_limits import OpenConnections
from service_kit.http_protocol import ServiceProtocol
from services.vlm_gateway.hot.exchange import Exchange
from services.vlm_gateway.hot.routes import BY_PATH, Route

MAX_AHEAD = 4
"""More requests than these, sent before an answer has come, are left on the socket; while there are fewer it is read,
so that a caller who leaves is noticed."""


class ChatServer(Protocol):
    """Who serves chats and what else models are asked."""

    max_body_bytes: int

    def serve(self, exchange: Exchange) -> Coroutine[Any, Any, None]: ...


class CallerProtocol(ServiceProtocol):
    """One connection of a caller."""

    def __init__(self, frontend: ChatServer, connections: OpenConnections, **uvicorns: Any) -> None:
        super().__init__(connections, **uvicorns)
        self._frontend = frontend
        self._coming: Exchange | None = None
        self._served: Exchange | None = None

    # -- what the parser tells

    def begin_head(self) -> None:
        self.url, self.headers, self.expect_100_continue = b"", [], False

    def on_request(self) -> None:
        self._coming = None
        parser = self.parser
        route = (BY_PATH.get(self.url) or self._route()) if parser.get_method() == b"POST" else None
        if route is None:
            self._through_framework()
            return
        modern = parser.get_http_version() != "1.0"
        keep_alive = modern and parser.should_keep_alive()
        limit = self._frontend.max_body_bytes
        exchange = Exchange(self, route, self.headers, keep_alive, modern, self.expect_100_continue, limit)
        before, self.cycle = self.cycle, cast(RequestResponseCycle, exchange)  # as far as its connection looks at it
        self._coming = exchange
        if before is None or before.response_complete:
            self._serve(exchange)
        else:
            self.pipeline.appendleft((self.cycle, self.app))
            if len(self.pipeline) == MAX_AHEAD:
                self.flow.pause_reading()

    def take_body(self, body: bytes) -> None:
        if self._coming is None:
            super().take_body(body)
        else:
            self._coming.came(body)
            if self._coming is not self._served and self._coming.size > HIGH_WATER_LIMIT:
                self.flow.pause_reading()

    def end_body(self) -> None:
        if self._coming is None:
            super().end_body()
        else:
            self._coming.came_whole()

    def _route(self) -> Route | None:
        return BY_PATH.get(unquote_to_bytes(httptools.parse_url(self.url).path or b""))

    def _through_framework(self) -> None:
        """Only here is a scope made of the head."""
        url, headers, expects_100 = self.url, self.headers, self.expect_100_continue
        super().begin_head()
        self.url, self.expect_100_continue = url, expects_100
        self.headers += headers  # the list that the scope has
        super().on_request()

    # -- what the connection does

    def connection_lost(self, exc: Exception | None) -> None:
        if self._served is not None:
            self._served.left()
        super().connection_lost(exc)

    def refuse_request(self, error: ServiceError) -> None:
        if self._coming is not None and self._coming is self._served and not self._coming.response_complete:
            self._coming.deadline.end(error)
        else:
            super().refuse_request(error)

    def _start_asgi_task(self, cycle: RequestResponseCycle | Exchange, app: Any) -> None:
        """Also called for what was pipelined, when its turn has come."""
        if isinstance(cycle, Exchange):
            self._serve(cycle)
        else:
            super()._start_asgi_task(cycle, app)

    def _serve(self, exchange: Exchange) -> None:
        self._served = exchange
        task = self.loop.create_task(self._frontend.serve(exchange))
        exchange.begins(task)
        self.tasks.add(task)
        task.add_done_callback(self.tasks.discard)
