"""Kept-alive connections to one server, used again while that is safe: `hot/connection.py` has the exchange itself."""

import asyncio
import ssl
from collections import deque
from collections.abc import Awaitable, Sequence
from typing import NamedTuple, cast

from service_kit.running_loop import running_loop
from services.vlm_gateway.upstream.connection import Connection
from services.vlm_gateway.upstream.http_reply import BrokenReply, Buffer, Reply, Stream

IDLE_S = 4.0
"""Connections unused for longer are not used again: common servers close theirs after 5 s."""
MAX_IDLE = 256


class Server(NamedTuple):
    """Where to connect; `tls` is None for plain HTTP."""

    host: str
    port: int
    tls: ssl.SSLContext | None


class Pool:
    """Connections to one server, the most recently used first. Deadlines are of the event loop's clock."""

    def __init__(
        self, server: Server, *, connect_timeout_s: float = 3.0, idle_s: float = IDLE_S, resend_unanswered: bool = False
    ) -> None:
        """`resend_unanswered`: a request that was written to a kept connection, and to which the server closed without
        a word, is sent again. It may have been read, and would then be answered twice."""
        self.server = server
        self._resend = ("not_sent", "no_reply") if resend_unanswered else ("not_sent",)
        self._connect_timeout_s = connect_timeout_s
        self._idle_s = idle_s
        self._idle: deque[Connection] = deque()
        self._live: set[Connection] = set()
        self._closed = False

    @property
    def idle(self) -> int:
        return len(self._idle)

    @property
    def live(self) -> int:
        return len(self._live)

    def whole(self, request: Sequence[Buffer], deadline: float, max_bytes: int) -> Awaitable[Reply]:
        """Send `request`, head and body, and wait for all of the reply. Raises BrokenReply."""
        return cast(Awaitable[Reply], self._sent(request, deadline, max_bytes))

    def stream(self, request: Sequence[Buffer], deadline: float) -> Awaitable[Stream]:
        """Send `request` and wait for the reply's head. Raises BrokenReply."""
        return cast(Awaitable[Stream], self._sent(request, deadline, None))

    def close(self) -> None:
        self._closed = True
        for connection in list(self._live):
            connection.leave()

    async def _sent(self, request: Sequence[Buffer], deadline: float, max_bytes: int | None) -> Reply | Stream:
        if connection := self._unused():
            try:
                reply = await connection.send(request, deadline, max_bytes)
            except BrokenReply as broken:
                if broken.reason not in self._resend:
                    raise
            else:
                return connection.stream() if reply is None else reply
        connection = await self._connected(deadline)
        reply = await connection.send(request, deadline, max_bytes)
        return connection.stream() if reply is None else reply

    def _unused(self) -> Connection | None:
        while self._idle:
            connection = self._idle.pop()
            if connection.is_fresh(self._idle_s):
                return connection
            connection.leave()
            while self._idle:  # whatever lies below was left earlier still
                self._idle.popleft().leave()
        return None

    async def _connected(self, deadline: float) -> Connection:
        loop = running_loop()
        limit = min(deadline, loop.time() + self._connect_timeout_s)
        host, port, tls = self.server
        try:
            async with asyncio.timeout_at(limit):
                _, connection = await loop.create_connection(
                    lambda: Connection(self), host, port, ssl=tls, server_hostname=host if tls else None
                )
        except TimeoutError:
            late = limit == deadline
            raise BrokenReply("late" if late else "connect", "no connection in time") from None
        except (OSError, ssl.SSLError) as error:
            raise BrokenReply("connect", f"no connection ({type(error).__name__})") from None
        return connection

    def opened(self, connection: Connection) -> None:
        self._live.add(connection)

    def left(self, connection: Connection) -> None:
        self._live.discard(connection)
        if connection in self._idle:
            self._idle.remove(connection)

    def back(self, connection: Connection) -> None:
        if self._closed or len(self._idle) >= MAX_IDLE:
            connection.leave()
        else:
            self._idle.append(connection)
