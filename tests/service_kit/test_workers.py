"""What workers share: in processes of their own, as forked ones have it."""

import multiprocessing
import os
import signal
import time
from collections.abc import Callable

import pytest

from service_kit.claim_table import HUNG_AFTER_S, SETS, WAYS
from service_kit.workers import COMMON, TOTAL, Board

FORK = multiprocessing.get_context("fork")


def elsewhere(work: Callable[[], None]) -> int | None:
    """`work` in another process; its exit code."""
    process = FORK.Process(target=work)
    process.start()
    process.join(20)
    return process.exitcode


def test_what_one_process_writes_under_the_lock_another_reads() -> None:
    board = Board()
    slot = board.slot("places")

    def add() -> None:
        for _ in range(2000):
            with board.locked():
                board.words[slot + COMMON] += 1.0

    others = [FORK.Process(target=add) for _ in range(2)]
    for process in others:
        process.start()
    for process in others:
        process.join(20)
    assert board.words[slot + COMMON] == 4000.0
    assert board.slot("places") == slot != board.slot("other places")


def test_a_worker_that_dies_with_the_lock_in_its_hands_stops_nobody() -> None:
    board = Board()
    slot = board.slot("places")

    def die() -> None:
        board.lock()
        board.words[slot + 1] = board.words[slot + TOTAL] = 3.0
        os.kill(os.getpid(), signal.SIGKILL)

    assert elsewhere(die) == -signal.SIGKILL
    board.forget(1)
    with board.locked():
        assert board.words[slot + 1] == board.words[slot + TOTAL] == 0.0


def test_one_worker_has_a_claim_until_it_lets_go_or_dies() -> None:
    board = Board()
    board.claims.alive(0)
    board.claims.alive(1)

    def claim() -> None:
        os._exit(int(board.claims.claim(7, 1)))

    assert elsewhere(claim) == 1
    assert not board.claims.claim(7, 0)
    board.claims.release(7, 0)  # of another's
    assert not board.claims.claim(7, 0)
    board.forget(1)
    assert board.claims.claim(7, 0)
    assert board.claims.claim(7, 0)
    assert elsewhere(claim) == 0
    board.claims.release(7, 0)
    assert elsewhere(claim) == 1


def test_a_worker_that_hangs_keeps_nobody_from_a_claim(monkeypatch: pytest.MonkeyPatch) -> None:
    claims = Board().claims
    claims.alive(1)
    assert claims.claim(7, 1)
    assert not claims.claim(7, 0)
    now = time.monotonic()
    monkeypatch.setattr("service_kit.claim_table.time.monotonic", lambda: now + HUNG_AFTER_S + 0.1)
    assert claims.claim(7, 0)
    claims.release(7, 1)  # it is not its any more
    claims.alive(0)
    assert not claims.claim(7, 1)


def test_where_there_is_no_room_for_a_claim_nobody_is_kept_from_anything() -> None:
    board = Board()
    board.claims.alive(0)
    alike = [1 + SETS * step for step in range(WAYS + 1)]
    assert all(board.claims.claim(name, 0) for name in alike)
    assert [board.claims.claim(name, 1) for name in alike] == [False] * WAYS + [True]
