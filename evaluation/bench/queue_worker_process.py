"""A worker of the queue as its machine sees it: a process, started again when it is killed."""

import asyncio
import contextlib
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path

from evaluation.bench.queue_worker import Post
from evaluation.bench.run import CannotRun
from evaluation.bench.worker_pool import ended

STOP_S = 40.0
RESTART_S = 1.0
MAX_ENDS_IN_A_ROW = 5
LONG_S = 60.0
"""A worker that has lived so long begins its count of ends anew."""

Tell = Callable[[str], None]


async def keep_working(post: Post, tell: Tell) -> None:
    """Until it is cancelled. `tell` is given a sentence for each episode and for each end of the process. Raises
    CannotRun where the worker can't work, or is killed again and again; OSError."""
    ends = 0
    while True:
        began = time.monotonic()
        code = await _lived(post, tell)
        ends = 1 if time.monotonic() - began > LONG_S else ends + 1
        how = f"by {signal.Signals(-code).name}" if code < 0 else f"with code {code}"
        if code >= 0 or ends >= MAX_ENDS_IN_A_ROW:
            raise CannotRun(f"a worker ended {how}; its log's last words: {_last_words(_log(post))}")
        tell(f"a worker was ended {how}; it is started again")
        await asyncio.sleep(RESTART_S)


async def _lived(post: Post, tell: Tell) -> int:
    """One process, to its end; its exit code, negative for a signal."""
    log = _log(post)
    log.parent.mkdir(parents=True, exist_ok=True)
    with log.open("ab") as errors:
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", "evaluation.bench.queue_worker"),
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            stderr=errors,
            # Ctrl-C reaches the command only, which then ends its workers in order
            start_new_session=True,
        )
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        with contextlib.suppress(ConnectionError):
            process.stdin.write(post.model_dump_json().encode() + b"\n")
            await process.stdin.drain()
        while line := await process.stdout.readline():
            tell(line.decode("utf-8", errors="replace").rstrip())
        return await process.wait()
    finally:
        process.stdin.close()
        await asyncio.shield(ended(process, STOP_S))


def _log(post: Post) -> Path:
    return Path(post.logs) / "queue-worker.log"


def _last_words(log: Path) -> str:
    lines = log.read_text(encoding="utf-8", errors="replace").strip().splitlines()
    return lines[-1][:500] if lines else "none"
