"""Chats straight from the socket and back; everything else is uvicorn's as it was.

uvicorn hands a body on in pieces, each with a message, an event, a copy and a pause of the socket: for a chat with a
picture that takes longer than all that is done about it here. So uvicorn's connection is used, with what it knows of
keep-alive, pipelining and shutdown, and one thing is done otherwise: a chat's body is gathered, and its answer written,
without messages.
"""

from collections.abc import Coroutine
from typing import Any, Protocol, cast
from urllib.parse import unquote_to_bytes

import httptools
from uvicorn.protocols.http.flow_control import HIGH_WATER_LIMIT
from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol, RequestResponseCycle

from services.vlm_gateway.hot.exchange import Exchange

PATH = "/v1/chat/completions"
MAX_AHEAD = 4
"""More requests than these, sent before an answer has come, are left on the socket; while there are fewer it is read,
so that a caller who leaves is noticed."""
_PATH = PATH.encode()


class ChatServer(Protocol):
    """Who serves the chats."""

    max_body_bytes: int

    def chat(self, exchange: Exchange) -> Coroutine[Any, Any, None]: ...


class CallerProtocol(HttpToolsProtocol):
    """One connection of a caller."""

    def __init__(self, frontend: ChatServer, **uvicorns: Any) -> None:
        super().__init__(**uvicorns)
        self._frontend = frontend
        self._coming: Exchange | None = None
        self._served: Exchange | None = None

    # -- what the parser tells

    def on_headers_complete(self) -> None:
        self._coming = None
        if self.parser.get_method() != b"POST" or self.parser.should_upgrade() or not self._is_chat():
            super().on_headers_complete()
            return
        keep_alive = self.parser.get_http_version() != "1.0" and self.parser.should_keep_alive()
        exchange = Exchange(self, self.headers, keep_alive, self.expect_100_continue, self._frontend.max_body_bytes)
        before, self.cycle = self.cycle, cast(RequestResponseCycle, exchange)  # as far as its connection looks at it
        self._coming = exchange
        if before is None or before.response_complete:
            self._serve(exchange)
        else:
            self.pipeline.appendleft((self.cycle, self.app))
            if len(self.pipeline) == MAX_AHEAD:
                self.flow.pause_reading()

    def on_body(self, body: bytes) -> None:
        if self._coming is None:
            super().on_body(body)
        else:
            self._coming.came(body)
            if self._coming is not self._served and self._coming.size > HIGH_WATER_LIMIT:
                self.flow.pause_reading()

    def on_message_complete(self) -> None:
        if self._coming is None:
            super().on_message_complete()
        else:
            self._coming.came_whole()

    def _is_chat(self) -> bool:
        return self.url == _PATH or unquote_to_bytes(httptools.parse_url(self.url).path or b"") == _PATH

    # -- what the connection does

    def connection_lost(self, exc: Exception | None) -> None:
        if self._served is not None:
            self._served.left()
        super().connection_lost(exc)

    def _start_asgi_task(self, cycle: RequestResponseCycle | Exchange, app: Any) -> None:
        """Also called for what was pipelined, when its turn has come."""
        if isinstance(cycle, Exchange):
            self._serve(cycle)
        else:
            super()._start_asgi_task(cycle, app)

    def _serve(self, exchange: Exchange) -> None:
        self._served = exchange
        task = self.loop.create_task(self._frontend.chat(exchange))
        exchange.begins(task)
        self.tasks.add(task)
        task.add_done_callback(self.tasks.discard)
