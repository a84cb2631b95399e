"""The customer at the terminal: is shown the question and types the answer."""

import asyncio
import os
import sys
from contextlib import AbstractContextManager
from typing import Protocol

from rich.console import Console
from rich.text import Text

from contracts.orchestrator import OpenQuestion
from mission.customer import DEFAULT_PATIENCE_S

MAX_ANSWER = 1000
_READ_BYTES = 8192


class View(Protocol):
    """What is drawn meanwhile, and can stand back."""

    def paused(self) -> AbstractContextManager[None]: ...


class TerminalCustomer:
    """Asks on the terminal. The end of input (Ctrl-D) is nobody who answers."""

    patience_s = DEFAULT_PATIENCE_S

    def __init__(self, console: Console, view: View) -> None:
        self._console = console
        self._view = view

    async def answer(self, number: int, question: OpenQuestion) -> str | None:
        with self._view.paused():
            self._console.print(Text(question.text, "bold yellow"), soft_wrap=True)
            while True:
                self._console.print("Your answer: ", end="", markup=False, highlight=False)
                line = await _read_line()
                if line is None:
                    self._console.print()
                    return None
                text = line.strip()
                if len(text) > MAX_ANSWER:
                    self._console.print(f"That is too long: {MAX_ANSWER} characters at most.", highlight=False)
                elif text:
                    return text


async def _read_line() -> str | None:
    """One line of standard input; null at its end. Cancelling it leaves nobody reading, as a thread would."""
    loop, descriptor = asyncio.get_running_loop(), sys.stdin.fileno()
    read: asyncio.Future[bytes] = loop.create_future()

    def take() -> None:
        if not read.done():
            read.set_result(os.read(descriptor, _READ_BYTES))

    loop.add_reader(descriptor, take)
    try:
        line = await read
    finally:
        loop.remove_reader(descriptor)
    return line.decode(errors="replace") if line else None
