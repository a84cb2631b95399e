"""Places and rates that are one for all workers of a gateway."""

import asyncio
from collections.abc import Callable

from service_kit.workers import COMMON, MAX_WORKERS, Worker


class SharedPlaces:
    """The places at one model, or of one key, over all workers; for `Admission` and `Key`."""

    def __init__(self, worker: Worker, name: str, concurrency: int) -> None:
        self._board = worker.board
        self._slot = worker.board.slot(name)
        self._me = worker.number
        self._concurrency = concurrency

    @property
    def taken(self) -> int:
        return int(sum(self._board.shares(self._slot)))

    def take(self) -> bool:
        with self._board.locked():
            if sum(self._board.shares(self._slot)) >= self._concurrency:
                return False
            self._board.put(self._slot, self._me, self._board.get(self._slot, self._me) + 1)
            return True

    def give_back(self) -> None:
        with self._board.locked():
            self._board.put(self._slot, self._me, self._board.get(self._slot, self._me) - 1)
            waiting = self._board.waiting(self._slot)
        for worker, count in enumerate(waiting):
            if count and worker != self._me:
                self._board.wake(worker)

    @property
    def waiting_elsewhere(self) -> int:
        waiting = self._board.waiting(self._slot)
        return int(sum(waiting) - waiting[self._me])

    def waits(self, count: int) -> None:
        """So many wait here: whoever gives a place back is to wake this worker."""
        self._board.put(self._slot, MAX_WORKERS + self._me, count)


class SharedBucket:
    """A rate's bucket: fills steadily up to a minute's worth; may be overdrawn. As `keys.Bucket`, for all workers."""

    def __init__(self, worker: Worker, name: str, per_minute: int, now: float) -> None:
        self._per_s = per_minute / 60.0
        self.size = float(per_minute)
        self._board = worker.board
        self._slot = worker.board.slot(name)
        with self._board.locked():
            if not self._board.get(self._slot, COMMON + 1):  # the first of all workers to come fills it
                self._board.put(self._slot, COMMON, self.size)
                self._board.put(self._slot, COMMON + 1, now)

    @property
    def level(self) -> float:
        return self._board.get(self._slot, COMMON)

    def add(self, amount: float) -> None:
        """Negative where it is spent."""
        with self._board.locked():
            self._board.put(self._slot, COMMON, self._board.get(self._slot, COMMON) + amount)

    def fill(self, now: float) -> float:
        with self._board.locked():
            level = self._board.get(self._slot, COMMON) + (now - self._board.get(self._slot, COMMON + 1)) * self._per_s
            self._board.put(self._slot, COMMON, min(self.size, level))
            self._board.put(self._slot, COMMON + 1, now)
            return min(self.size, level)

    def wait_s(self, amount: float) -> float:
        return (amount - self.level) / self._per_s


class Bell:
    """Tells this worker's queues when another has given a place back."""

    def __init__(self, worker: Worker, woken: Callable[[], None]) -> None:
        self._worker = worker
        self._woken = woken

    def start(self) -> None:
        """In the loop that serves."""
        asyncio.get_running_loop().add_reader(self._worker.board.bell(self._worker.number), self._ring)

    def _ring(self) -> None:
        self._worker.board.hush(self._worker.number)
        self._woken()
