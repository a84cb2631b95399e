"""Keeps a group of services running: one that ends is started again, more slowly each time, until it is given up."""

import asyncio
import signal
import time
from collections.abc import Callable
from typing import NamedTuple

from launcher.processes import CannotStart, Child, Processes

LOOK_EVERY_S = 0.1


class RestartPolicy(NamedTuple):
    """The first restart comes after `first_s` seconds, each further one within `within_s` after twice as many as the
    one before, `longest_s` at most. A service that ends more than `times` within `within_s` is given up."""

    first_s: float = 0.25
    longest_s: float = 8.0
    times: int = 5
    within_s: float = 60.0


class GaveUp(Exception):
    """A service ends again and again; the message says which, and its last words."""


class Supervisor:
    """`tell` is given a sentence for everything that happens."""

    def __init__(self, group: Processes, tell: Callable[[str], None], policy: RestartPolicy | None = None) -> None:
        self._group = group
        self._tell = tell
        self._policy = policy or RestartPolicy()

    async def run(self) -> None:
        """Until it is cancelled. Raises GaveUp."""
        try:
            async with asyncio.TaskGroup() as tasks:
                for child in self._group.children:
                    tasks.create_task(self._keep(child))
        except* GaveUp as group:
            raise group.exceptions[0] from None

    async def _keep(self, child: Child) -> None:
        ends: list[float] = []
        while True:
            await asyncio.sleep(LOOK_EVERY_S)
            if child.process.poll() is None:
                continue
            now = time.monotonic()
            ends = [*(end for end in ends if now - end < self._policy.within_s), now]
            how = last_words(child)
            if len(ends) > self._policy.times:
                raise GaveUp(
                    f"{child.name} ended {len(ends)} times within {self._policy.within_s:g} s and is given up; {how}. "
                    f"Its log is {child.log}"
                )
            pause_s = min(self._policy.longest_s, self._policy.first_s * 2 ** (len(ends) - 1))
            self._tell(f"{how}; it is started again in {pause_s:g} s")
            await asyncio.sleep(pause_s)
            child = await self._started_again(child)

    async def _started_again(self, child: Child) -> Child:
        """The new process, ready, or ended once more: then the next round finds it so."""
        try:
            child = self._group.start_again(child)
            await self._group.ready_child(child)
        except CannotStart as error:
            self._tell(str(error))
            if child.process.poll() is None:
                child.process.kill()
        else:
            self._tell(f"{child.name} is ready again")
        return child


def last_words(child: Child) -> str:
    """How a process ended, for a person."""
    code = child.process.returncode or 0
    how = f"was ended by {signal.Signals(-code).name}" if code < 0 else f"ended with code {code}"
    words = child.tail()
    return f"{child.name} {how}" + (f", its log's last words: {words}" if words else "")
