"""The configuration read anew while the gateway runs: at SIGHUP, and when its file or a key's file has changed.

A file may be looked at while it is being written, and half of one may be sound. So a change counts when the files are
at the next look what they were at the one before; a signal says itself that all is written.
"""

import asyncio
import contextlib
import logging
import signal
import time
from collections.abc import Callable, Coroutine, Iterable, Sequence
from pathlib import Path
from typing import Any

from service_kit.settings import BadSetting
from services.vlm_gateway.backends.base import Backend
from services.vlm_gateway.chat.backend import ChatBackend

log = logging.getLogger(__name__)

EVERY_S = 1.0
SETTLE_S = 1.0
"""Calls that were about to start when a backend was replaced have started by then."""
LONGEST_S = 3600.0


class Reloader:
    """`reload` reads the configuration and puts it in place, and returns the back ends that are no longer asked; it
    raises BadSetting and changes nothing where the configuration is wrong. `files` are those it depends on."""

    def __init__(
        self,
        reload: Callable[[], Sequence[Backend]],
        files: Callable[[], Iterable[Path]],
        every_s: float = EVERY_S,
    ) -> None:
        self._reload = reload
        self._files = files
        self._every_s = every_s
        self._read = self._last = self._signature()
        self._asked = asyncio.Event()
        self._tasks: set[asyncio.Task[None]] = set()
        self.loaded_at = time.time()
        self.problem = ""

    def start(self) -> None:
        """In the loop that serves."""
        with contextlib.suppress(ValueError, RuntimeError):  # signals are the main thread's alone
            asyncio.get_running_loop().add_signal_handler(signal.SIGHUP, self._asked.set)
        self._spawn(self._watch())

    async def close(self) -> None:
        tasks, self._tasks = self._tasks, set()
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    def status(self) -> dict[str, object]:
        return {"loaded_at": round(self.loaded_at, 3), "problem": self.problem}

    def now(self) -> None:
        """Read it; what is wrong is told in the log and in the status, and the old one stays."""
        self._read = self._signature()
        try:
            retired = self._reload()
        except (BadSetting, OSError, ValueError) as error:
            self.problem = str(error)
            log.error("the configuration was not reloaded, the old one stays: %s", error)
            return
        self.problem = ""
        self.loaded_at = time.time()
        log.warning("the configuration was reloaded; %d back ends replaced", len(retired))
        for backend in retired:
            self._spawn(_retire(backend))

    async def _watch(self) -> None:
        while True:
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(self._every_s):
                    await self._asked.wait()
            if self.has_changed() or self._asked.is_set():
                self._asked.clear()
                self.now()

    def has_changed(self) -> bool:
        """Whether the files are others than those that were read, and nobody writes them any more."""
        before, self._last = self._last, self._signature()
        return self._read != self._last == before

    def _signature(self) -> list[tuple[str, int, int, int]]:
        """Changes when one of the files does."""
        found = []
        for path in self._files():
            try:
                stat = path.expanduser().stat()
                found.append((str(path), stat.st_mtime_ns, stat.st_ino, stat.st_size))
            except OSError:
                found.append((str(path), 0, 0, 0))
        return found

    def _spawn(self, work: Coroutine[Any, Any, None]) -> None:
        task = asyncio.ensure_future(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)


async def _retire(backend: Backend) -> None:
    """Close it once nobody is asking it any more."""
    give_up = time.monotonic() + LONGEST_S
    await asyncio.sleep(SETTLE_S)
    while isinstance(backend, ChatBackend) and time.monotonic() < give_up:
        admission = backend.upstream.admission
        if not admission.running and not admission.waiting:
            break
        await asyncio.sleep(0.2)
    await backend.close()
