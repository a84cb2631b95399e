"""The connections to model servers, against servers that end, cut, drip, babble and answer early."""

import asyncio
import socket
import struct
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from typing import NamedTuple

import pytest

from services.vlm_gateway.upstream.connection import MAX_HEAD_BYTES
from services.vlm_gateway.upstream.http_reply import BrokenReply, Reply
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


WHOLE = [
    ("a length", HELLO, 200, b"hello"),
    (
        "chunks",
        b"HTTP/1.1 200 OK\r\ntransfer-encoding: chunked\r\n\r\n2\r\nhe\r\n3;x=y\r\nllo\r\n0\r\nt: v\r\n\r\n",
        200,
        b"hello",
    ),
    ("no body at all", b"HTTP/1.1 204 No Content\r\n\r\n", 204, b""),
    ("an empty body", b"HTTP/1.1 200 OK\r\ncontent-length: 0\r\n\r\n", 200, b""),
    ("a hint and then the reply", b"HTTP/1.1 103 Early Hints\r\nlink: x\r\n\r\n" + HELLO, 200, b"hello"),
    ("leave to go on and then the reply", b"HTTP/1.1 100 Continue\r\n\r\n" + HELLO, 200, b"hello"),
    ("an error", b"HTTP/1.1 429 Slow Down\r\nretry-after: 3\r\ncontent-length: 2\r\n\r\nno", 429, b"no"),
]


@pytest.mark.parametrize(("raw", "status", "body"), [w[1:] for w in WHOLE], ids=[w[0] for w in WHOLE])
async def test_a_reply_is_read_whole_wherever_it_is_cut_on_its_way(raw: bytes, status: int, body: bytes) -> None:
    for size in (len(raw), 7, 1):
        pieces = [raw[at : at + size] for at in range(0, len(raw), size)]
        async with server(always(*pieces)) as peer:
            for _ in range(2):
                reply = await peer.ask()
                assert (reply.status, reply.body) == (status, body)
            await asyncio.sleep(0)
            assert len(peer.visitors) == 1  # and the connection serves again


async def test_without_a_length_the_end_of_the_connection_is_the_end_of_the_reply() -> None:
    async with server(once(b"HTTP/1.1 200 OK\r\n\r\nhel", b"lo")) as peer:
        assert (await peer.ask()).body == b"hello"
        assert (await peer.ask()).body == b"hello"
        assert len(peer.visitors) == 2


async def test_a_server_that_says_close_is_not_written_to_again() -> None:
    async with server(always(HELLO.replace(b"\r\n\r\n", b"\r\nconnection: close\r\n\r\n"))) as peer:
        assert [(await peer.ask()).body for _ in range(2)] == [b"hello"] * 2
        assert len(peer.visitors) == 2
        assert peer.pool.idle == 0


@pytest.mark.parametrize("resend", [False, True])
@pytest.mark.parametrize("abruptly", [False, True])
async def test_a_request_that_was_read_and_not_answered_is_sent_again_only_where_that_is_configured(
    abruptly: bool, resend: bool
) -> None:
    async def handle(visitor: Visitor) -> None:
        await visitor.request()
        await visitor.say(HELLO)
        if visitor.number == 0:
            await visitor.request()
            if abruptly:
                visitor.reset()
            return
        await visitor.reader.read()

    async with server(handle) as peer:
        pool = Pool(peer.pool.server, resend_unanswered=resend)
        asked = Peer(pool, peer.visitors)
        assert (await asked.ask()).body == b"hello"
        if resend:
            assert (await asked.ask()).body == b"hello"
            assert len(peer.visitors) == 2
        else:
            with pytest.raises(BrokenReply) as broken:
                await asked.ask()
            assert broken.value.reason == "no_reply"
            assert len(peer.visitors) == 1
        pool.close()


async def test_a_request_that_could_not_be_written_in_full_is_sent_again() -> None:
    large = [REQUEST[0].replace(b"2", b"9000000"), b"x" * 9_000_000]

    async def handle(visitor: Visitor) -> None:
        await visitor.request()
        if visitor.number == 0:
            await visitor.say(HELLO)
            await visitor.reader.readuntil(b"\r\n\r\n")
            visitor.reset()  # in the middle of the second request
            return
        await visitor.reader.readexactly(9_000_000 - 2)
        await visitor.say(HELLO)

    async with server(handle) as peer:
        assert (await peer.ask()).body == b"hello"
        reply = await peer.pool.whole(large, asyncio.get_running_loop().time() + 20, MANY)
        assert reply.body == b"hello"
        assert len(peer.visitors) == 2


async def test_a_server_that_closes_between_two_requests_costs_nobody_an_error() -> None:
    closed = asyncio.Event()

    async def handle(visitor: Visitor) -> None:
        await visitor.request()
        await visitor.say(HELLO)
        if visitor.number == 0:
            visitor.writer.close()
            closed.set()

    async with server(handle) as peer:
        for _ in range(20):
            assert (await peer.ask()).body == b"hello"
        assert closed.is_set()


async def test_a_kept_connection_that_was_closed_meanwhile_is_not_used() -> None:
    async def handle(visitor: Visitor) -> None:
        await visitor.request()
        await visitor.say(HELLO)

    async with server(handle) as peer:
        await peer.ask()
        await nobody_left(peer.pool)
        assert (await peer.ask()).body == b"hello"


async def test_connections_are_not_used_again_after_a_while() -> None:
    async with server(always(HELLO)) as peer:
        pool = Pool(peer.pool.server, idle_s=0.0)
        for _ in range(2):
            await pool.whole(REQUEST, asyncio.get_running_loop().time() + 5, MANY)
        assert len(peer.visitors) == 2
        pool.close()


BROKEN = [
    ("it ends before a word", once(), "no_reply"),
    ("it ends inside the head", once(b"HTTP/1.1 200 OK\r\ncontent-le"), "cut"),
    ("it ends inside a body with a length", once(b"HTTP/1.1 200 OK\r\ncontent-length: 9\r\n\r\nhello"), "cut"),
    ("it ends inside a chunk", once(b"HTTP/1.1 200 OK\r\ntransfer-encoding: chunked\r\n\r\n9\r\nhello"), "cut"),
    ("it ends between chunks", once(b"HTTP/1.1 200 OK\r\ntransfer-encoding: chunked\r\n\r\n5\r\nhello\r\n"), "cut"),
    ("it ends after a hint", once(b"HTTP/1.1 103 Early Hints\r\n\r\n"), "cut"),
    ("it is no HTTP", once(b"SSH-2.0-OpenSSH_9.6\r\n"), "garbage"),
    ("its length is none", once(b"HTTP/1.1 200 OK\r\ncontent-length: five\r\n\r\nhello"), "garbage"),
    ("it has two lengths", once(b"HTTP/1.1 200 OK\r\ncontent-length: 5\r\ncontent-length: 6\r\n\r\nhello!"), "garbage"),
    ("its chunks are none", once(b"HTTP/1.1 200 OK\r\ntransfer-encoding: chunked\r\n\r\nhello\r\n"), "garbage"),
    ("it is compressed", once(b"HTTP/1.1 200 OK\r\ncontent-encoding: gzip\r\ncontent-length: 1\r\n\r\nx"), "garbage"),
    ("its body is too large", once(b"HTTP/1.1 200 OK\r\ncontent-length: 2000\r\n\r\n" + b"x" * 2000), "too_large"),
    ("its body never ends", once(b"HTTP/1.1 200 OK\r\n\r\n" + b"x" * 5000, pause_s=0.01), "too_large"),
    ("it has too many headers", once(b"HTTP/1.1 200 OK\r\n" + b"a: b\r\n" * MAX_HEAD_BYTES), "too_large"),
    ("a header never ends", once(b"HTTP/1.1 200 OK\r\na: ", b"b" * (2 * MAX_HEAD_BYTES), pause_s=0.05), "too_large"),
    ("it says nothing", once(b"", pause_s=30), "late"),
    ("it drips", once(b"HTTP/1.1 200 OK\r\ncontent-length: 100\r\n\r\n", *[b"x"] * 100, pause_s=0.05), "late"),
]


@pytest.mark.parametrize(("handle", "reason"), [b[1:] for b in BROKEN], ids=[b[0] for b in BROKEN])
async def test_a_reply_that_is_none_says_why_and_leaves_nothing_behind(handle: Handler, reason: str) -> None:
    async with server(handle) as peer:
        with pytest.raises(BrokenReply) as raised:
            await peer.ask(within_s=0.5 if reason == "late" else 5.0, max_bytes=1000)
        assert raised.value.reason == reason
        await nobody_left(peer.pool)
        assert peer.pool.idle == 0


async def test_a_connection_reset_in_a_reply_is_a_cut() -> None:
    async def handle(visitor: Visitor) -> None:
        await visitor.request()
        await visitor.say(b"HTTP/1.1 200 OK\r\n\r\nhello", pause_s=0.05)
        visitor.reset()  # without a length, only a proper end is an end

    async with server(handle) as peer:
        with pytest.raises(BrokenReply) as raised:
            await peer.ask()
        assert raised.value.reason == "cut"


async def test_nobody_there_is_told_at_once() -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        pool = Pool(Server("127.0.0.1", probe.getsockname()[1], None))
    with pytest.raises(BrokenReply) as raised:
        await pool.whole(REQUEST, asyncio.get_running_loop().time() + 5, MANY)
    assert raised.value.reason == "connect"


async def test_a_reply_that_comes_before_the_request_is_through_counts() -> None:
    async def handle(visitor: Visitor) -> None:
        await visitor.reader.readuntil(b"\r\n\r\n")
        await visitor.say(b"HTTP/1.1 413 Too Large\r\ncontent-length: 3\r\n\r\nbig")
        await asyncio.sleep(30)  # and never reads the rest

    async with server(handle) as peer:
        body = bytes(20 * 1024 * 1024)
        head = b"POST / HTTP/1.1\r\nhost: x\r\ncontent-length: %d\r\n\r\n" % len(body)
        reply = await peer.pool.whole([head, body], asyncio.get_running_loop().time() + 10, MANY)
        assert (reply.status, reply.body) == (413, b"big")
        await asyncio.sleep(0)
        assert peer.pool.idle == 0  # half a request is on the line


@pytest.mark.parametrize("behind", [b"x", HELLO])
async def test_bytes_behind_a_reply_are_never_the_next_one(behind: bytes) -> None:
    async with server(always(HELLO + behind.replace(b"hello", b"other"))) as peer:
        for _ in range(3):
            assert (await peer.ask()).body == b"hello"
            await asyncio.sleep(0.01)
        assert len(peer.visitors) == 3


async def test_an_exchange_that_is_given_up_does_not_meet_the_next_one() -> None:
    async with server(always(HELLO, pause_s=0.2)) as peer:

        async def slow(visitor: Visitor) -> None:
            while await visitor.request():
                await asyncio.sleep(0.2)
                await visitor.say(HELLO)

        async with server(slow) as sleepy:
            asking = asyncio.create_task(sleepy.ask())
            await asyncio.sleep(0.05)
            asking.cancel()
            await asyncio.gather(asking, return_exceptions=True)
            assert (await sleepy.ask()).body == b"hello"
            assert len(sleepy.visitors) == 2
        assert (await peer.ask()).body == b"hello"


async def test_many_at_a_time_each_get_their_own_reply() -> None:
    async def echo(visitor: Visitor) -> None:
        while True:
            try:
                head = await visitor.reader.readuntil(b"\r\n\r\n")
            except (asyncio.IncompleteReadError, ConnectionError):
                return
            word = head.split(b" ")[1]
            await asyncio.sleep(0.001 * (len(word) % 3))
            await visitor.say(b"HTTP/1.1 200 OK\r\ncontent-length: %d\r\n\r\n" % len(word) + word)

    async with server(echo) as peer:
        deadline = asyncio.get_running_loop().time() + 20

        async def one(number: int) -> bool:
            word = b"/%d" % (10**number % 7919 * number)
            request = [b"GET " + word + b" HTTP/1.1\r\nhost: x\r\n\r\n"]
            return all([(await peer.pool.whole(request, deadline, MANY)).body == word for _ in range(10)])

        assert all(await asyncio.gather(*(one(number) for number in range(30))))
        assert len(peer.visitors) <= 60


async def test_a_stream_comes_piece_by_piece_and_gives_its_connection_back() -> None:
    chunks = [b"HTTP/1.1 200 OK\r\ntransfer-encoding: chunked\r\n\r\n", b"3\r\none\r\n", b"3\r\ntwo\r\n", b"0\r\n\r\n"]
    async with server(always(*chunks, pause_s=0.02)) as peer:
        loop = asyncio.get_running_loop()
        for _ in range(2):
            stream = await peer.pool.stream(REQUEST, loop.time() + 5)
            pieces = []
            while piece := await stream.piece(loop.time() + 5):
                pieces.append(piece)
            assert pieces == [b"one", b"two"]
            assert await stream.piece(loop.time() + 5) == b""
            stream.close()
            await asyncio.sleep(0)
        assert len(peer.visitors) == 1


async def test_a_stream_that_is_left_closes_its_connection() -> None:
    async with server(always(b"HTTP/1.1 200 OK\r\ncontent-length: 100\r\n\r\nx")) as peer:
        stream = await peer.pool.stream(REQUEST, asyncio.get_running_loop().time() + 5)
        stream.close()
        assert (peer.pool.idle, peer.pool.live) == (0, 0)
        for _ in range(5000):
            if peer.visitors[0].reader.at_eof():
                return
            await asyncio.sleep(0.001)
        raise AssertionError("the server was left waiting")


async def test_what_a_stream_has_sent_can_be_read_after_it_broke() -> None:
    async with server(once(b"HTTP/1.1 200 OK\r\ncontent-length: 100\r\n\r\nhello")) as peer:
        loop = asyncio.get_running_loop()
        stream = await peer.pool.stream(REQUEST, loop.time() + 5)
        await asyncio.sleep(0.1)
        assert await stream.piece(loop.time() + 5) == b"hello"
        with pytest.raises(BrokenReply) as raised:
            await stream.piece(loop.time() + 5)
        assert raised.value.reason == "cut"


async def test_a_slow_reader_holds_the_server_up_rather_than_filling_memory() -> None:
    size, sent = 32 * 1024 * 1024, 0

    async def handle(visitor: Visitor) -> None:
        nonlocal sent
        await visitor.request()
        await visitor.say(b"HTTP/1.1 200 OK\r\ncontent-length: %d\r\n\r\n" % size)
        for _ in range(size // 65536):
            await visitor.say(bytes(65536))
            sent += 65536

    async with server(handle) as peer:
        loop = asyncio.get_running_loop()
        stream = await peer.pool.stream(REQUEST, loop.time() + 5)
        before = -1
        while before != sent:
            before = sent
            await asyncio.sleep(0.2)
        assert sent < size // 2  # the sockets' own buffers and ours, and no more
        got = 0
        while piece := await stream.piece(loop.time() + 10):
            got += len(piece)
        assert got == size
