"""Names that one worker each has claimed, in memory that all workers share."""

import mmap
import time
from collections.abc import Callable

SETS = 1024
WAYS = 8
"""A name has so many places where it may stand; with 64 claims at a time, no room comes once in 10^13 claims."""

HUNG_AFTER_S = 3.0
"""What a worker has claimed that said nothing for so long may be claimed by others."""


class ClaimTable:
    """`lock` and `unlock` keep the others out meanwhile. To be made before the workers are."""

    def __init__(self, lock: Callable[[], object], unlock: Callable[[], object]) -> None:
        words = memoryview(mmap.mmap(-1, 2 * 8 * SETS * WAYS)).cast("Q")
        self._names, self._owners = words[: SETS * WAYS], words[SETS * WAYS :]
        self._alive_at = memoryview(mmap.mmap(-1, 8 * 256)).cast("d")
        self._lock, self._unlock = lock, unlock

    def claim(self, name: int, worker: int) -> bool:
        """Whether this worker has it now; false where another one does. `name` is a hash of 64 bits, not 0. Where there
        is no room, nobody is kept from anything."""
        first = name % SETS * WAYS
        self._lock()
        try:
            names = self._names[first : first + WAYS].tolist()
            if name not in names and 0 not in names:
                return True
            at = first + names.index(name if name in names else 0)
            anothers = self._names[at] and self._owners[at] != worker + 1
            if anothers and time.monotonic() - self._alive_at[self._owners[at] - 1] < HUNG_AFTER_S:
                return False
            self._names[at], self._owners[at] = name, worker + 1
            return True
        finally:
            self._unlock()

    def alive(self, worker: int) -> None:
        """To be said again and again by a worker that has something: it is at it still."""
        self._alive_at[worker] = time.monotonic()

    def release(self, name: int, worker: int) -> None:
        """Where this worker has it."""
        first = name % SETS * WAYS
        self._lock()
        try:
            for at in range(first, first + WAYS):
                if self._names[at] == name and self._owners[at] == worker + 1:
                    self._names[at] = self._owners[at] = 0
        finally:
            self._unlock()

    def forget(self, worker: int) -> None:
        """All that a dead worker had; to be called under the lock."""
        for at, owner in enumerate(self._owners.tolist()):
            if owner == worker + 1:
                self._names[at] = self._owners[at] = 0
