"""A lock on a file that one process holds at a time, for as long as it has the file open."""

import fcntl
from typing import IO


class HeldElsewhere(Exception):
    """Another process holds the lock."""


def hold(file: IO[str] | IO[bytes]) -> None:
    """Locks an open file; the operating system frees it when the file is closed, or its process ends, however. A file
    system without locks lets everybody have it. Raises HeldElsewhere."""
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise HeldElsewhere from None
    except OSError:
        pass
