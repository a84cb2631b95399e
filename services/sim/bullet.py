"""PyBullet, without the banner that it writes to standard error whenever it is imported."""

import os
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def _without_standard_error() -> Iterator[None]:
    """What C code writes there in the meantime is lost: the banner comes from no Python that could be told not to."""
    kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)


with _without_standard_error():
    import pybullet

__all__ = ["pybullet"]
