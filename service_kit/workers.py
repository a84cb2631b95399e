"""One service as several processes that share a port: who starts them, replaces them, and ends them.

The supervisor takes the port and forks; each worker listens at it with a socket of its own, among which the kernel
shares out the connections (SO_REUSEPORT). What the workers share beside the port is a `Board`. SIGTERM and SIGINT end
all of them gracefully, SIGHUP is passed on to each; a worker that dies is replaced, and what it held is given back.
"""

import fcntl
import logging
import mmap
import multiprocessing
import os
import signal
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from hashlib import blake2b
from multiprocessing.context import ForkProcess
from pathlib import Path

from service_kit.claim_table import ClaimTable

log = logging.getLogger(__name__)

MAX_WORKERS = 32
SLOTS = 1024
COMMON = 2 * MAX_WORKERS
TOTAL = COMMON + 2
SLOT_WORDS = 1 + TOTAL + 1
"""Of a slot: its key, each worker's share, how many wait at each, two words that are everybody's, the shares' sum."""
DIED_LOCKED_S = 1.0
RESTART_AFTER_S = 0.2


class NoRoom(Exception):
    """The board has no slot left."""


class Board:
    """Numbers that all workers see, by name: each has its own share of one, and says how many wait there. To be made
    before the workers are."""

    def __init__(self) -> None:
        self._memory = mmap.mmap(-1, SLOTS * SLOT_WORDS * 8)
        self.words = memoryview(self._memory).cast("d")
        self._lock = multiprocessing.get_context("fork").Lock()
        self.lock = self._lock.acquire
        self.unlock = self._lock.release
        self.claims = ClaimTable(self.lock, self.unlock)
        self._bells = [os.eventfd(0, os.EFD_NONBLOCK) for _ in range(MAX_WORKERS)]

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Nobody else reads or writes meanwhile. Not to be nested, nor to be held for longer than a few steps: others
        stand still. `lock` and `unlock` do the same, quicker."""
        self.lock()
        try:
            yield
        finally:
            self.unlock()

    def slot(self, name: str) -> int:
        """Where the numbers of this name are: the first of its `words`. Raises NoRoom."""
        key = blake2b(name.encode(), digest_size=8).digest()
        with self.locked():
            first = int.from_bytes(key, "little")
            for step in range(SLOTS):
                at = (first + step) % SLOTS * SLOT_WORDS
                there = self._memory[8 * at : 8 * at + 8]
                if there == bytes(8):
                    self._memory[8 * at : 8 * at + 8] = key
                if there in (key, bytes(8)):
                    return at + 1
        raise NoRoom(f"more than {SLOTS} numbers are shared")

    def wake(self, worker: int) -> None:
        os.eventfd_write(self._bells[worker], 1)

    def hush(self, worker: int) -> None:
        """It has been woken."""
        with suppress(BlockingIOError):
            os.eventfd_read(self._bells[worker])

    def bell(self, worker: int) -> int:
        """The file descriptor that becomes readable when this worker is woken."""
        return self._bells[worker]

    def forget(self, worker: int) -> None:
        """What a dead worker held, and those that waited at it; the others are woken. Where it died with the lock in
        its hands, that is taken from it."""
        self._lock.acquire(timeout=DIED_LOCKED_S)  # a living worker never holds it for so long
        try:
            for at in range(1, SLOTS * SLOT_WORDS, SLOT_WORDS):
                self.words[at + TOTAL] -= self.words[at + worker]
                self.words[at + worker] = self.words[at + MAX_WORKERS + worker] = 0.0
            self.claims.forget(worker)
        finally:
            self.unlock()
        for other in range(MAX_WORKERS):
            self.wake(other)


class Worker:
    """One of the processes: its number, and what it shares."""

    def __init__(self, number: int, count: int, board: Board, folder: str) -> None:
        self.number = number
        self.count = count
        self.board = board
        self.folder = folder

    def started(self) -> None:
        """It serves."""
        Path(self.folder, "started").touch()

    @contextmanager
    def alone(self) -> Iterator[None]:
        """No other worker starts meanwhile: they open the same files."""
        with Path(self.folder, "starting").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            yield


def bound_socket(host: str, port: int) -> socket.socket:
    """At a port that others of this user may be bound to as well. Raises OSError."""
    bound = socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET)
    bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
    bound.bind((host, port))
    return bound


class Supervisor:
    """`serve` in each of `count` processes; it is called there and returns when its worker has ended."""

    def __init__(self, count: int, serve: Callable[[Worker], None], folder: str) -> None:
        self._count = count
        self._serve = serve
        self._folder = folder
        self._board = Board()
        self._workers: dict[int, ForkProcess] = {}
        self._stopping = False
        self._failed = False

    def run(self) -> bool:
        """Until all have ended; false where they can't be started."""
        signals = {signal.SIGCHLD, signal.SIGTERM, signal.SIGINT, signal.SIGHUP}
        before = signal.pthread_sigmask(signal.SIG_BLOCK, signals)
        for number in range(self._count):
            self._fork(number, before)
        while self._workers:
            got = signal.sigwait(signals)
            if got == signal.SIGCHLD:
                self._reap(before)
            elif got == signal.SIGHUP:
                self._tell(signal.SIGHUP)
            else:
                self._stopping = True
                self._tell(signal.SIGTERM)
        return not self._failed

    def _fork(self, number: int, mask: set[int | signal.Signals]) -> None:
        worker = Worker(number, self._count, self._board, self._folder)
        process = multiprocessing.get_context("fork").Process(target=self._be, args=(worker, mask))
        process.start()
        self._workers[number] = process

    def _be(self, worker: Worker, mask: set[int | signal.Signals]) -> None:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        self._serve(worker)

    def _reap(self, mask: set[int | signal.Signals]) -> None:
        for number, process in list(self._workers.items()):
            if process.exitcode is None:
                continue
            del self._workers[number]
            self._board.forget(number)
            if self._stopping:
                continue
            if not Path(self._folder, "started").exists():  # none ever served: they can't be started
                self._failed = self._stopping = True
                self._tell(signal.SIGTERM)
                continue
            log.error("worker %d ended with status %d and is replaced", number, process.exitcode)
            time.sleep(RESTART_AFTER_S)
            self._fork(number, mask)

    def _tell(self, what: signal.Signals) -> None:
        for process in self._workers.values():
            if process.pid is not None and process.exitcode is None:
                os.kill(process.pid, what)
