"""Replies that are none, and exchanges that end otherwise than they should."""

import asyncio
import socket

import pytest

from services.vlm_gateway.upstream.connection import MAX_HEAD_BYTES
from services.vlm_gateway.upstream.http_reply import BrokenReply
from services.vlm_gateway.upstream.pool import Pool, Server
from tests.services.vlm_gateway.upstream.servers import (
    HELLO,
    MANY,
    REQUEST,
    Handler,
    Visitor,
    always,
    nobody_left,
    once,
    server,
)

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
