"""Memory that a service no longer needs is given back: what requests left behind in circles, and pages of the C
library's heaps on which nothing lives any more. And there are few such heaps: glibc makes up to eight for each core,
and what lives for long on a page of each of them keeps that page."""

import ctypes
import gc
import threading
import time

from service_kit.settings import process_environment

TIDY_EVERY_S = 60.0
HEAPS = 2
_M_ARENA_MAX = -8
"""glibc's malloc.h."""


def share_heaps() -> None:
    """From now on threads share `HEAPS` heaps, unless the environment says otherwise (`MALLOC_ARENA_MAX`, glibc's own).
    Heaps that are there already stay: call it before there are threads."""
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None and "MALLOC_ARENA_MAX" not in process_environment():
        mallopt(_M_ARENA_MAX, HEAPS)


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
