"""How long a battery lasts: the usual first, then what was measured."""

import pytest

from mission.endurance import USUAL_S, left_s


def test_before_anything_is_measured_a_battery_lasts_as_usual() -> None:
    assert left_s(1.0, 1.0, 0.0, 0.2) == pytest.approx(0.8 * USUAL_S)
    assert left_s(None, None, 0.0, 0.2) == pytest.approx(0.8 * USUAL_S)


def test_a_battery_that_was_not_full_at_the_start_has_not_emptied_by_that() -> None:
    assert left_s(0.6, 0.6, 5.0, 0.2) == pytest.approx(0.4 * USUAL_S, rel=0.05)


def test_a_battery_that_empties_fast_is_believed_the_more_the_longer_it_does() -> None:
    real_s = 400.0
    early, late = (left_s(1.0 - t / real_s, 1.0, t, 0.2) / (0.8 * real_s - t) for t in (20.0, 240.0))
    assert early > late > 1.0
    assert late < 1.35


def test_a_simulators_battery_that_drops_to_a_half_at_take_off_and_stays_there_flies_on() -> None:
    assert left_s(0.5, 1.0, 30.0, 0.2) > 60.0
    assert left_s(0.5, 1.0, 300.0, 0.2) > 150.0


def test_at_the_reserve_nothing_is_left() -> None:
    assert left_s(0.2, 1.0, 300.0, 0.2) == 0.0
