"""What the commands of `logisticsvln` share: how they show that they go on, and how they end."""

import asyncio
import signal
from collections.abc import Callable, Coroutine, Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import Any, NoReturn, Self, TypeVar

import typer
from rich.console import Console
from rich.live import Live
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

WRONG_INPUT, FAILED, INTERRUPTED = 2, 1, 130
T = TypeVar("T")


class Redrawn:
    """A view that is drawn in one place of the terminal while it is entered."""

    def __init__(self, drawing: Live | Progress) -> None:
        self._drawing = drawing

    def __enter__(self) -> Self:
        self._drawing.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._drawing.stop()

    @contextmanager
    def paused(self) -> Iterator[None]:
        """Leaves the terminal to somebody else meanwhile."""
        self._drawing.stop()
        try:
            yield
        finally:
            self._drawing.start()


class Printed:
    """A view of lines that stay: for pipes, logs and CI. Entered as the other kind is, it holds nothing."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        return None

    @contextmanager
    def paused(self) -> Iterator[None]:
        """As the other kind: it holds nothing."""
        yield


def bar(console: Console) -> Progress:
    """A bar with a job's description, how many are done and the time left; gone when it is over."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    return Progress(*columns, console=console, transient=True)


async def interruptible(work: Coroutine[Any, Any, T], told: Callable[[], None] = lambda: None) -> T:
    """`work`, which SIGINT and SIGTERM cancel; for commands that end with it. `told` hears of the first. A second
    Ctrl-C does nothing, that what has begun can be put in order; a second SIGTERM ends the process. Raises
    asyncio.CancelledError when it was cancelled."""
    task, loop = asyncio.current_task(), asyncio.get_running_loop()

    def leave() -> None:
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.remove_signal_handler(number)
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        told()
        if task is not None:
            task.cancel()

    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, leave)
    return await work


def stop(message: str, code: int) -> NoReturn:
    """End the command with one line that says why."""
    typer.echo(f"logisticsvln: {' '.join(message.split())}", err=True)
    raise typer.Exit(code)
