"""What a service gives back to the system."""

import gc
import os
import subprocess
import sys
from pathlib import Path

import pytest

from service_kit.tidying import tidy

PIECES, BYTES = 20_000, 3_000
HEAPS_OF_EIGHT_THREADS = """
import ctypes, sys, threading
from service_kit.tidying import share_heaps

share_heaps()
all_there = threading.Barrier(8)


def work():
    pieces = [b"x" * 3_000 for _ in range(100)]
    all_there.wait(60)


threads = [threading.Thread(target=work) for _ in range(8)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
libc = ctypes.CDLL(None)
libc.fopen.restype = ctypes.c_void_p
file = ctypes.c_void_p(libc.fopen(sys.argv[1].encode(), b"w"))
libc.malloc_info(0, file)
libc.fclose(file)
"""


def own_mb() -> float:
    lines = Path("/proc/self/status").read_text().splitlines()
    return sum(int(line.split()[1]) for line in lines if line.startswith("RssAnon:")) / 1024


def test_pages_between_what_lives_are_given_back() -> None:
    pieces = [b"x" * BYTES for _ in range(PIECES)]
    left = pieces[::100]
    full_mb = own_mb()
    pieces.clear()
    tidy()
    assert own_mb() < full_mb - 0.7 * PIECES * BYTES / 1e6
    assert len(left) == PIECES // 100


def test_what_is_left_in_circles_is_taken_away() -> None:
    gc.disable()
    try:
        circle: list[object] = [b"x" * 50_000_000]
        circle.append(circle)
        full_mb = own_mb()
        del circle
        tidy()
        assert own_mb() < full_mb - 40
    finally:
        gc.enable()


@pytest.mark.parametrize(("setting", "heaps"), [({}, 2), ({"MALLOC_ARENA_MAX": "5"}, 5)])
def test_threads_share_few_heaps_unless_the_environment_says_how_many(
    tmp_path: Path, setting: dict[str, str], heaps: int
) -> None:
    environment = {k: v for k, v in os.environ.items() if k != "MALLOC_ARENA_MAX"} | setting
    told = tmp_path / "heaps.xml"
    subprocess.run([sys.executable, "-c", HEAPS_OF_EIGHT_THREADS, told], env=environment, check=True)
    assert told.read_text().count("<heap nr=") == heaps
