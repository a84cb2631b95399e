"""The running event loop, without asking the kernel.

`asyncio.get_running_loop` of Python 3.11 asks for the process's number at every call, to notice a fork: a system call,
several of them for every request that is served.
"""

import asyncio
import os
import threading


class _Here(threading.local):
    """The loop that was found running in this thread last."""

    loop: asyncio.AbstractEventLoop | None = None


_here = _Here()


def running_loop() -> asyncio.AbstractEventLoop:
    """As `asyncio.get_running_loop`: the loop that runs in this thread. Raises RuntimeError where none does."""
    loop = _here.loop
    if loop is None or not loop.is_running():  # no other can run in this thread while that one does
        loop = _here.loop = asyncio.get_running_loop()
    return loop


def _forget() -> None:
    _here.loop = None


os.register_at_fork(after_in_child=_forget)
