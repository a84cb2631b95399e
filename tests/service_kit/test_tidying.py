"""What a service gives back to the system."""

import gc
from pathlib import Path

from service_kit.tidying import tidy

PIECES, BYTES = 20_000, 3_000


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
