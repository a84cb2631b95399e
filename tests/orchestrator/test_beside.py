"""Two streams as one."""

import asyncio
from collections.abc import AsyncIterator

import pytest

from orchestrator.beside import beside


async def counted(*pauses_s: float, fails: bool = False) -> AsyncIterator[float]:
    for pause_s in pauses_s:
        await asyncio.sleep(pause_s)
        yield pause_s
    if fails:
        raise ValueError("broken")


async def test_what_two_streams_give_comes_as_it_comes_and_ends_with_the_first() -> None:
    found = [item async for item in beside(counted(0.0, 0.03, 0.01), counted(0.005, 0.015, 10.0))]
    assert sorted(found) == [0.0, 0.005, 0.01, 0.015, 0.03]
    assert found[0] == 0.0


async def test_the_second_stream_may_end_before_the_first() -> None:
    assert [item async for item in beside(counted(0.0, 0.02), counted())] == [0.0, 0.02]


async def test_what_breaks_one_stream_breaks_both() -> None:
    with pytest.raises(ValueError, match="broken"):
        [item async for item in beside(counted(0.0, 10.0), counted(0.0, fails=True))]


async def test_whoever_leaves_early_leaves_nothing_running() -> None:
    before = asyncio.all_tasks()
    both = beside(counted(0.0, 10.0), counted(10.0))
    assert await anext(both) == 0.0
    await both.aclose()
    assert asyncio.all_tasks() == before
