"""Two streams as one."""

import asyncio
from collections.abc import AsyncIterator

import pytest

from orchestrator.beside import beside


class Stream:
    """Gives what it is handed, when it is handed it; an exception is raised, None ends it."""

    def __init__(self) -> None:
        self._handed: asyncio.Queue[str | Exception | None] = asyncio.Queue()

    def hand(self, item: str | Exception | None) -> None:
        self._handed.put_nowait(item)

    async def given(self) -> AsyncIterator[str]:
        while (item := await self._handed.get()) is not None:
            if isinstance(item, Exception):
                raise item
            yield item


async def test_what_two_streams_give_comes_as_it_comes_and_ends_with_the_first() -> None:
    first, second = Stream(), Stream()
    both = beside(first.given(), second.given())
    for stream, item in ((first, "a"), (second, "b"), (second, "c"), (first, "d")):
        stream.hand(item)
        assert await anext(both) == item
    first.hand(None)
    assert [item async for item in both] == []


async def test_the_second_stream_may_end_before_the_first() -> None:
    first, second = Stream(), Stream()
    both = beside(first.given(), second.given())
    second.hand(None)
    for item in "ab":
        first.hand(item)
        assert await anext(both) == item
    first.hand(None)
    assert [item async for item in both] == []


async def test_what_breaks_one_stream_breaks_both() -> None:
    first, second = Stream(), Stream()
    both = beside(first.given(), second.given())
    first.hand("a")
    assert await anext(both) == "a"
    second.hand(ValueError("broken"))
    with pytest.raises(ValueError, match="broken"):
        await anext(both)


async def test_whoever_leaves_early_leaves_nothing_running() -> None:
    before = asyncio.all_tasks()
    first, second = Stream(), Stream()
    both = beside(first.given(), second.given())
    first.hand("a")
    assert await anext(both) == "a"
    await both.aclose()
    assert asyncio.all_tasks() == before
