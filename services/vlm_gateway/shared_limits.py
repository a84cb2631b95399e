"""Places and rates that are one for all workers of a gateway."""

import asyncio
from collections.abc import Callable

from service_kit.workers import COMMON, MAX_WORKERS, TOTAL, Worker


class SharedPlaces:
    """The places at one model, or of one key, over all workers; for `Admission` and `Key`."""

    def __init__(self, worker: Worker, name: str, concurrency: int) -> None:
        self._board = board = worker.board
        self._words = board.words
        slot = board.slot(name)
        self._total = slot + TOTAL
        self._mine = slot + worker.number
        self._waiting_here = slot + MAX_WORKERS + worker.number
        self._waiting = slice(slot + MAX_WORKERS, slot + MAX_WORKERS + worker.count)
        self._me = worker.number
        self._concurrency = concurrency

    @property
    def taken(self) -> int:
        return int(self._words[self._total])

    def take(self) -> bool:
        words, total = self._words, self._total
        self._board.lock()
        try:
            if words[total] >= self._concurrency:
                return False
            words[total] += 1.0
            words[self._mine] += 1.0
            return True
        finally:
            self._board.unlock()

    def give_back(self) -> None:
        words = self._words
        self._board.lock()
        try:
            words[self._total] -= 1.0
            words[self._mine] -= 1.0
            waiting = words[self._waiting].tolist()
        finally:
            self._board.unlock()
        for worker, count in enumerate(waiting):
            if count and worker != self._me:
                self._board.wake(worker)

    @property
    def waiting_elsewhere(self) -> int:
        return int(sum(self._words[self._waiting]) - self._words[self._waiting_here])

    def waits(self, count: int) -> None:
        """So many wait here: whoever gives a place back is to wake this worker."""
        self._words[self._waiting_here] = count


class SharedBucket:
    """A rate's bucket: fills steadily up to a minute's worth; may be overdrawn. As `keys.Bucket`, for all workers."""

    def __init__(self, worker: Worker, name: str, per_minute: int, now: float) -> None:
        self.per_s = per_minute / 60.0
        self.size = float(per_minute)
        self._board = worker.board
        self._words = worker.board.words
        slot = worker.board.slot(name)
        self._level = slot + COMMON  # and behind it when that was
        with self._board.locked():
            if not self._words[self._level + 1]:  # the first of all workers to come fills it
                self._words[self._level] = self.size
                self._words[self._level + 1] = now

    @property
    def level(self) -> float:
        return self._words[self._level]

    def add(self, amount: float) -> None:
        """Negative where it is spent."""
        self._board.lock()
        try:
            self._words[self._level] += amount
        finally:
            self._board.unlock()

    def spend(self, amount: float, least: float, now: float) -> bool:
        words, at = self._words, self._level
        self._board.lock()
        try:
            level = min(self.size, words[at] + (now - words[at + 1]) * self.per_s)
            spent = level > 0.0 and level >= least
            words[at] = level - amount if spent else level
            words[at + 1] = now
            return spent
        finally:
            self._board.unlock()

    def wait_s(self, amount: float) -> float:
        return (amount - self.level) / self.per_s


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
