"""A request of the customer's own in a scene whose goal was set for other words, told as what came of it."""

import pytest

from contracts.sim import ClaimedWindow, Shown, Verdict
from mission.own_request import fits, judged_by_words

RED = Shown(floor=4, names=("red flower pot", "red plant pot", "flower pot", "plant pot"))
GREEN = Shown(floor=4, names=("green flower pot", "green plant pot", "flower pot", "plant pot"))
EMPTY = Shown(floor=4, names=())


def verdict(claimed: Shown, goal: Shown | None = GREEN, *, distance_m: float = 1.9, collided: bool = False) -> Verdict:
    window = ClaimedWindow(
        claimed=claimed,
        goal=goal,
        distance_m=distance_m,
        in_front=True,
        line_of_sight=True,
        nearest_window=True,
        aside_deg=5.0,
    )
    return Verdict(
        judged=goal is not None,
        delivered=False,
        right_window=False if goal is not None else None,
        distance_m=6.0,
        in_front=True,
        line_of_sight=True,
        collided=collided,
        window=window,
    )


def test_the_window_that_was_named_is_found_though_the_scenes_goal_is_another() -> None:
    judged = judged_by_words(verdict(RED), 4, "red flower pot")
    assert judged is not None
    assert judged.outcome == "stopped_not_judged"
    assert judged.message == (
        "in front of a window with a red flower pot on floor 4, as asked, 1.9 m from its centre; "
        "the goal of the scene itself is another"
    )
    assert (judged.verdict.judged, judged.verdict.delivered, judged.verdict.right_window) == (False, False, None)
    assert judged.verdict.distance_m == 1.9


def test_a_window_without_the_thing_is_told_with_what_is_there() -> None:
    judged = judged_by_words(verdict(GREEN), 4, "red flower pot")
    assert judged is not None
    assert judged.outcome == "wrong_window"
    assert "without a red flower pot on floor 4 (there is a green flower pot on floor 4)" in judged.message
    other_floor = judged_by_words(verdict(RED), 3, "red flower pot")
    assert other_floor is not None
    assert other_floor.outcome == "wrong_window"


def test_a_stop_too_far_off_and_a_collision_are_no_success() -> None:
    far = judged_by_words(verdict(RED, distance_m=4.0), 4, "red flower pot")
    hit = judged_by_words(verdict(RED, collided=True), 4, "red flower pot")
    assert (far and far.outcome, hit and hit.outcome) == ("not_in_front", "collision")


def test_words_that_mean_the_goal_are_judged_by_it() -> None:
    assert judged_by_words(verdict(RED), 4, "green flower pot") is None
    assert judged_by_words(verdict(RED).model_copy(update={"window": None}), 4, "red flower pot") is None


def test_without_a_goal_nothing_is_said_of_one() -> None:
    judged = judged_by_words(verdict(RED, goal=None), 4, "red flower pot")
    assert judged is not None
    assert judged.message.endswith("as asked, 1.9 m from its centre")


@pytest.mark.parametrize(
    ("thing", "fitting"),
    [
        ("red flower pot", True),
        ("big red plant pot", True),
        ("flower pot", True),
        ("Red flower-pot", True),
        ("green flower pot", False),
        ("red pot", False),
        ("red kite", False),
        (None, False),
    ],
)
def test_words_fit_a_thing_that_they_name_whole(thing: str | None, fitting: bool) -> None:
    assert fits(RED, 4, thing) is fitting
    assert not fits(EMPTY, 4, thing)
