"""Batches made ahead of time by other threads, while the network is busy with the last one."""

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Generic, TypeVar

B = TypeVar("B")


class Prefetch(Generic[B]):
    """`make(number)` gives batch `number`, whoever calls it and when; `workers` 0 makes each when it is asked for."""

    def __init__(self, make: Callable[[int], B], workers: int) -> None:
        self._make, self._workers = make, workers
        self._threads = ThreadPoolExecutor(workers, thread_name_prefix="batch") if workers else None
        self._coming: dict[int, Future[B]] = {}

    def get(self, number: int) -> B:
        """Batch `number`; the next ones are begun."""
        if self._threads is None:
            return self._make(number)
        for n in range(number, number + self._workers + 1):
            if n not in self._coming:
                self._coming[n] = self._threads.submit(self._make, n)
        for n in [n for n in self._coming if n < number]:
            self._coming.pop(n).cancel()
        return self._coming.pop(number).result()
