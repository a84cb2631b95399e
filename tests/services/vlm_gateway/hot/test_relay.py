"""One stream for several callers, longer than what may be held of it."""

import asyncio
from collections.abc import AsyncIterator

import pytest

from services.vlm_gateway.errors import ModelUnreachable
from services.vlm_gateway.hot.relay import MAX_SHARED_BYTES, Broadcast, Course, Pieces

PIECE = b"x" * 256 * 1024
COUNT = 3 * MAX_SHARED_BYTES // len(PIECE)


class Stream:
    """`COUNT` pieces as fast as they are wanted; `sent` so far."""

    def __init__(self) -> None:
        self.sent = 0
        self.over = 0

    async def pieces(self) -> Pieces:
        for number in range(COUNT):
            self.sent += 1
            yield b"%06d" % number + PIECE
            await asyncio.sleep(0)

    def broadcast(self) -> Broadcast:
        return Broadcast(self.pieces(), Course("m"), self.closed)

    def closed(self) -> None:
        self.over += 1


async def numbers(pieces: AsyncIterator[bytes]) -> list[int]:
    return [int(piece[:6]) async for piece in pieces]


async def test_a_stream_of_any_length_reaches_all_who_read_along() -> None:
    stream = Stream()
    shared = stream.broadcast()
    read = await asyncio.gather(*(numbers(shared.read()) for _ in range(3)))
    assert read == [list(range(COUNT))] * 3
    assert stream.over == 1


async def test_the_first_caller_is_waited_for_and_never_broken_off() -> None:
    stream = Stream()
    first = stream.broadcast().read()
    assert (await anext(first)).startswith(b"000000")
    before = 0
    while stream.sent != before:
        before = stream.sent
        await asyncio.sleep(0.05)
    assert stream.sent <= MAX_SHARED_BYTES // len(PIECE) + 2
    assert await numbers(first) == list(range(1, COUNT))


async def test_a_late_caller_who_falls_behind_is_told_so_and_holds_up_nobody() -> None:
    stream = Stream()
    shared = stream.broadcast()
    first, late = shared.read(), shared.read()
    assert (await anext(first)).startswith(b"000000")
    assert (await anext(late)).startswith(b"000000")
    assert await numbers(first) == list(range(1, COUNT))
    with pytest.raises(ModelUnreachable, match="too slow"):
        await numbers(late)


async def test_when_the_first_caller_leaves_the_next_is_never_broken_off() -> None:
    stream = Stream()
    shared = stream.broadcast()
    first, second = shared.read(), shared.read()
    await anext(first)
    await anext(second)
    await first.aclose()
    await asyncio.sleep(0.05)
    assert await numbers(second) == list(range(1, COUNT))


async def test_when_all_have_left_a_long_stream_is_broken_off() -> None:
    stream = Stream()
    only = stream.broadcast().read()
    await anext(only)
    await only.aclose()
    await asyncio.sleep(0.05)
    assert stream.sent < COUNT
