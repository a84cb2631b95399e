"""When a soak rests."""

import pytest

from service_kit.tidying import TIDY_EVERY_S
from tests.load.soak import rest_s


@pytest.mark.parametrize("delivery_s", [4.0, 15.0, 37.0])
def test_each_five_minutes_of_an_hour_have_a_rest_in_which_services_give_back_what_they_can(delivery_s: float) -> None:
    now_s, rests = 0.0, []
    while now_s < 3600.0:
        now_s += delivery_s
        rest = rest_s(60.0, now_s, len(rests))
        if rest:
            rests.append((now_s, now_s + rest))
            now_s += rest
    assert len(rests) == 12
    for window, (begun_s, ended_s) in enumerate(rests):
        assert begun_s >= 300 * window
        assert ended_s - begun_s > TIDY_EVERY_S
        assert ended_s <= 300 * (window + 1) + delivery_s


def test_a_short_soak_does_not_rest() -> None:
    assert not any(rest_s(20.0, float(now_s), 0) for now_s in range(0, 1200, 10))
