"""Whole replies of model servers, wherever they are cut, and connections that are used again."""

import asyncio

import pytest

from services.vlm_gateway.upstream.http_reply import BrokenReply
from services.vlm_gateway.upstream.pool import Pool
from tests.services.vlm_gateway.upstream.servers import (
    HELLO,
    MANY,
    REQUEST,
    Peer,
    Visitor,
    always,
    nobody_left,
    once,
    server,
)

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
