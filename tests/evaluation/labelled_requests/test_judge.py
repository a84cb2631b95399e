"""An answer to a labelled request is right, asks, or is silently wrong."""

import pytest

from evaluation.labelled_requests.judge import Reading, is_exactly, is_object, judge
from evaluation.labelled_requests.read import LabelledRequest

POT = LabelledRequest(
    text="4th floor, my pot, it's red and has two handles",
    floor=4,
    object="red pot with two handles",
    object_text=("pot, it's red", "two handles"),
    also_ok=("red pot",),
)
OPEN = LabelledRequest(text="4th or 5th floor, the red pot", floor=None, object="red pot")
NOTHING = LabelledRequest(text="hello", floor=None, object=None)


@pytest.mark.parametrize(
    ("request_", "reading", "outcome"),
    [
        (POT, Reading(4, "red pot with two handles"), "right"),
        (POT, Reading(4, "red pot"), "right"),
        (POT, Reading(5, "red pot"), "silently_wrong"),
        (POT, Reading(4, "blue vase"), "silently_wrong"),
        (POT, Reading(None, "red pot"), "asks"),
        (POT, Reading(4, None), "asks"),
        (POT, Reading(None, "blue vase"), "asks"),
        (OPEN, Reading(None, "red pot"), "right"),
        (OPEN, Reading(4, "red pot"), "silently_wrong"),
        (NOTHING, Reading(None, None), "right"),
        (NOTHING, Reading(3, None), "asks"),
        (NOTHING, Reading(3, "pot"), "silently_wrong"),
    ],
)
def test_each_answer_ends_as_one_of_three(request_: LabelledRequest, reading: Reading, outcome: str) -> None:
    assert judge(request_, reading).outcome == outcome


def test_an_answer_that_could_not_be_read_is_never_right() -> None:
    assert judge(NOTHING, Reading(None, None, readable=False)).outcome == "asks"


@pytest.mark.parametrize(
    ("answer", "same", "exact"),
    [
        ("Red Pots with two handles", True, True),
        ("a red pot w/ two handles", True, True),
        ("red pot with handles", True, False),
        ("pot", False, False),
        ("two handles", False, False),
        ("green pot", False, False),
        ("", False, False),
        (None, False, False),
    ],
)
def test_the_thing_may_be_named_in_other_words_but_not_by_a_part_of_it(
    answer: str | None, same: bool, exact: bool
) -> None:
    assert is_object(POT, answer) is same
    assert is_exactly(POT, answer or "") is exact


def test_floor_and_object_are_judged_apart() -> None:
    judged = judge(POT, Reading(5, "red pot"))
    assert (judged.floor, judged.object, judged.object_exact) == (False, True, True)
