"""Memory that a service no longer needs is given back: what requests left behind in circles, and pages of the C
library's heaps on which nothing lives any more, which it otherwise keeps for each thread."""

import ctypes
import gc
import threading
import time

TIDY_EVERY_S = 60.0


def tidy() -> None:
    """Takes some milliseconds."""
    gc.collect()
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)  # glibc's; others have none
    if trim is not None:
        trim(0)


def keep_tidy() -> None:
    """From now on, as long as the process lives."""
    threading.Thread(target=_again_and_again, name="tidying", daemon=True).start()


def _again_and_again() -> None:
    while True:
        time.sleep(TIDY_EVERY_S)
        tidy()
