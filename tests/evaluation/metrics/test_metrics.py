"""Every figure by hand on small cases, the empty case included."""

import math

import numpy as np
import pytest

from evaluation.metrics.paired import mcnemar, paired_bootstrap
from evaluation.metrics.proportion import proportion, share
from evaluation.metrics.spl import Flown, spl


def test_the_wilson_interval_of_a_known_case() -> None:
    # 81 of 263, Newcombe 1998 (Stat. Med. 17), table I, method 3: 0.2553 to 0.3662
    p = proportion(81, 263)
    assert p.rate == pytest.approx(81 / 263)
    assert p.low == pytest.approx(0.2553, abs=5e-5)
    assert p.high == pytest.approx(0.3662, abs=5e-5)


def test_none_and_all_have_intervals_that_end_there() -> None:
    # Newcombe 1998: 0 of 20 gives 0 to 0.1611, 29 of 29 gives 0.8830 to 1
    assert proportion(0, 20)[3:] == pytest.approx((0.0, 0.1611), abs=5e-5)
    assert proportion(29, 29)[3:] == pytest.approx((0.8830, 1.0), abs=5e-5)


def test_no_tasks_have_no_rate() -> None:
    assert share([]) == (0, 0, None, None, None)
    assert str(share([])) == "0/0 n/a"
    assert str(share([True, False])).startswith("1/2 50.0 % [")


@pytest.mark.parametrize(("k", "n"), [(-1, 3), (4, 3)])
def test_a_count_outside_its_total_is_refused(k: int, n: int) -> None:
    with pytest.raises(ValueError, match=r"0\.\.n"):
        proportion(k, n)


def test_spl_weighs_success_by_efficiency() -> None:
    # 10/20, then a failure, then a flight shorter than the shortest way by rounding: 1
    tasks = [Flown(True, 10.0, 20.0), Flown(False, 10.0, 10.0), Flown(True, 10.0, 9.99)]
    assert spl(tasks) == pytest.approx((0.5 + 0.0 + 1.0) / 3)


def test_spl_of_nothing_and_of_a_start_at_the_goal() -> None:
    assert spl([]) is None
    assert spl([Flown(True, 0.0, 5.0)]) == 1.0


@pytest.mark.parametrize("length", [-1.0, math.inf, math.nan])
def test_a_length_that_is_none_is_refused(length: float) -> None:
    with pytest.raises(ValueError, match="finite"):
        spl([Flown(True, 5.0, length)])


def test_mcnemar_by_hand() -> None:
    # 5 tasks only the first solved, 1 only the second: 2 * (C(6,0) + C(6,1)) / 64 = 14 / 64
    first = [True] * 5 + [False] + [True] * 4
    second = [False] * 5 + [True] + [True] * 4
    assert mcnemar(first, second) == (5, 1, pytest.approx(14 / 64))
    assert mcnemar(second, first).p == pytest.approx(14 / 64)


def test_arms_that_agree_are_not_told_apart() -> None:
    assert mcnemar([True, False], [True, False]).p == 1.0
    assert mcnemar([], []).p == 1.0


def test_the_bootstrap_finds_a_difference_and_only_where_there_is_one() -> None:
    rng = np.random.default_rng(5)
    noise = rng.normal(0, 1, 200)
    clear = paired_bootstrap(list(noise + 1.0), list(noise + rng.normal(0, 0.1, 200)), np.random.default_rng(1))
    assert clear.mean == pytest.approx(1.0, abs=0.05)
    assert clear.low is not None
    assert clear.low > 0.9
    assert clear.p is not None
    assert clear.p < 0.001
    level = paired_bootstrap([1.0, 0.0, 1.0, 0.0], [0.0, 1.0, 0.0, 1.0], np.random.default_rng(1))
    assert level.p is not None
    assert level.p > 0.5


def test_the_bootstrap_is_its_generators() -> None:
    arms = ([1.0, 2.0, 3.0], [1.0, 0.0, 1.0])
    assert paired_bootstrap(*arms, np.random.default_rng(3)) == paired_bootstrap(*arms, np.random.default_rng(3))


def test_unpaired_arms_are_refused_and_empty_ones_have_no_difference() -> None:
    with pytest.raises(ValueError, match="same tasks"):
        mcnemar([True], [])
    with pytest.raises(ValueError, match="same tasks"):
        paired_bootstrap([1.0], [], np.random.default_rng(0))
    assert paired_bootstrap([], [], np.random.default_rng(0)) == (None, None, None, None)
