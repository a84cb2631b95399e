"""Streams of model servers: piece by piece, left, broken, read slowly."""

import asyncio

import pytest

from services.vlm_gateway.upstream.http_reply import BrokenReply
from tests.services.vlm_gateway.upstream.servers import REQUEST, Visitor, always, once, server


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
