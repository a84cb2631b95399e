"""Servers that end, cut, drip, babble and answer early, for the tests of the connections to model servers."""

import asyncio
import socket
import struct
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from typing import NamedTuple

from services.vlm_gateway.upstream.http_reply import Reply
from services.vlm_gateway.upstream.pool import Pool, Server

HELLO = b"HTTP/1.1 200 OK\r\ncontent-length: 5\r\n\r\nhello"
CHUNKED = b"HTTP/1.1 200 OK\r\ntransfer-encoding: chunked\r\n\r\n"
REQUEST = [b"POST / HTTP/1.1\r\nhost: x\r\ncontent-length: 2\r\n\r\n", b"ok"]
MANY = 1_000_000

Handler = Callable[["Visitor"], Awaitable[None]]


class Visitor(NamedTuple):
    """One connection as the server sees it; `number` counts them from 0."""

    number: int
    reader: asyncio.StreamReader
    writer: asyncio.StreamWriter

    async def request(self) -> bool:
        """Whether another whole request came."""
        try:
            await self.reader.readuntil(b"\r\n\r\n")
            await self.reader.readexactly(2)
        except (asyncio.IncompleteReadError, ConnectionError):
            return False
        return True

    async def say(self, *pieces: bytes, pause_s: float = 0.0) -> None:
        for piece in pieces:
            self.writer.write(piece)
            await self.writer.drain()
            await asyncio.sleep(pause_s)

    def reset(self) -> None:
        """End the connection without a goodbye."""
        sock: socket.socket = self.writer.get_extra_info("socket")
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        self.writer.transport.abort()


class Peer(NamedTuple):
    """A running server; `visitors` fills as they come."""

    pool: Pool
    visitors: list[Visitor]

    async def ask(self, within_s: float = 5.0, max_bytes: int = MANY) -> Reply:
        return await self.pool.whole(REQUEST, asyncio.get_running_loop().time() + within_s, max_bytes)


@asynccontextmanager
async def server(handle: Handler) -> AsyncIterator[Peer]:
    visitors: list[Visitor] = []
    tasks: set[asyncio.Task[None]] = set()

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        tasks.add(task)
        visitor = Visitor(len(visitors), reader, writer)
        visitors.append(visitor)
        try:
            await handle(visitor)
        except (ConnectionError, asyncio.CancelledError):
            pass
        finally:
            writer.close()

    running = await asyncio.start_server(serve, "127.0.0.1", 0)
    pool = Pool(Server("127.0.0.1", running.sockets[0].getsockname()[1], None))
    try:
        yield Peer(pool, visitors)
    finally:
        pool.close()
        running.close()
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


async def nobody_left(pool: Pool) -> None:
    """Returns once all connections are gone."""
    for _ in range(5000):
        if not pool.live:
            return
        await asyncio.sleep(0.001)
    raise AssertionError("a connection was left")


def always(*pieces: bytes, pause_s: float = 0.0) -> Handler:
    """Says the same to every request and keeps the connection."""

    async def handle(visitor: Visitor) -> None:
        while await visitor.request():
            await visitor.say(*pieces, pause_s=pause_s)

    return handle


def once(*pieces: bytes, pause_s: float = 0.0) -> Handler:
    """Says it to one request and closes."""

    async def handle(visitor: Visitor) -> None:
        if await visitor.request():
            await visitor.say(*pieces, pause_s=pause_s)

    return handle
