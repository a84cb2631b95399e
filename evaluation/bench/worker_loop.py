"""A worker's side of its pipe: one line in, one line out. When its input ends, so does it, and its services with it."""

import asyncio
import contextlib
import sys
from collections.abc import Callable
from typing import Protocol

from pydantic import ValidationError

from contracts.base import Wire
from contracts.errors import first_problem
from launcher.processes import CannotStart

LINE_LIMIT = 64 * 1024 * 1024


class Ready(Wire):
    """A worker's first answer: `problem` says why it can't work, where it can't."""

    problem: str | None = None


class WorkerLogic(Protocol):
    """What a worker does between the lines."""

    async def start(self) -> None:
        """Raises CannotStart."""

    async def answer(self, line: bytes, gone: asyncio.Event) -> Wire | None:
        """The answer to one line, whatever happened; null when `gone` was set meanwhile. Raises
        pydantic.ValidationError for a line that is no question."""

    async def stop(self) -> None: ...


async def serve(new_worker: Callable[[bytes], WorkerLogic]) -> int:
    """The process: answers every line of its input; the first makes the worker. Returns its exit status."""
    loop = asyncio.get_running_loop()
    reader = asyncio.StreamReader(limit=LINE_LIMIT)
    await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(reader), sys.stdin)
    first = await reader.readline()
    if not first:
        return 0
    worker = new_worker(first)
    gone = asyncio.Event()
    lines: asyncio.Queue[bytes] = asyncio.Queue()

    async def listen() -> None:
        while line := await reader.readline():
            lines.put_nowait(line)
        gone.set()
        lines.put_nowait(b"")

    listener = asyncio.create_task(listen())
    try:
        starting = asyncio.create_task(worker.start())
        leaving = asyncio.create_task(gone.wait())
        await asyncio.wait({starting, leaving}, return_when=asyncio.FIRST_COMPLETED)
        leaving.cancel()
        if not starting.done():
            starting.cancel()
            await asyncio.wait({starting})
            return 0
        try:
            starting.result()
        except CannotStart as error:
            _say(Ready(problem=str(error)))
            return 1
        _say(Ready())
        while line := await lines.get():
            answer = await worker.answer(line, gone)
            if answer is None:
                break
            _say(answer)
        return 0
    finally:
        listener.cancel()
        await worker.stop()


def answer_lines(module: str, new_worker: Callable[[bytes], WorkerLogic]) -> int:
    """A worker's whole process. Returns the exit status; a message that is not of the contract ends it with one line
    on standard error, in the name of `module`."""
    try:
        # the parent may have been killed: then its end of the pipe is closed
        with contextlib.suppress(BrokenPipeError):
            return asyncio.run(serve(new_worker))
    except ValidationError as error:
        sys.stderr.write(f"{module}: {first_problem(error)}\n")
        return 2
    return 0


def _say(message: Wire) -> None:
    sys.stdout.write(message.model_dump_json() + "\n")
    sys.stdout.flush()
