"""Two streams as one."""

import asyncio
from collections.abc import AsyncIterator
from typing import TypeVar

T = TypeVar("T")


async def beside(main: AsyncIterator[T], other: AsyncIterator[T]) -> AsyncIterator[T]:
    """What both give, as it comes; it ends with `main`, and raises what either raises."""
    waiting = {asyncio.ensure_future(anext(source)): source for source in (main, other)}
    try:
        while True:
            done, _ = await asyncio.wait(waiting, return_when=asyncio.FIRST_COMPLETED)
            for task in done:
                source = waiting.pop(task)
                try:
                    yield task.result()
                except StopAsyncIteration:
                    if source is main:
                        return
                    continue
                waiting[asyncio.ensure_future(anext(source))] = source
    finally:
        for task in waiting:
            task.cancel()
        await asyncio.gather(*waiting, return_exceptions=True)
