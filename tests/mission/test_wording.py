"""Messages in words that a reader does not stumble over."""

import pytest

from mission.policies.points import search_task
from mission.wording import counted, with_article


@pytest.mark.parametrize(
    ("n", "said"), [(0, "0 sightings"), (1, "1 sighting"), (2, "2 sightings"), (21, "21 sightings")]
)
def test_a_number_has_its_noun_in_the_right_form(n: int, said: str) -> None:
    assert counted(n, "sighting") == said


def test_an_irregular_plural_is_named() -> None:
    assert [counted(n, "success", "successes") for n in (1, 2)] == ["1 success", "2 successes"]


@pytest.mark.parametrize(
    ("thing", "said"),
    [
        ("cake", "a cake"),
        ("orange stool", "an orange stool"),
        ("Umbrella", "an Umbrella"),
        ("unicorn", "a unicorn"),
        ("European flag", "a European flag"),
        ("one-legged flamingo", "a one-legged flamingo"),
        ("the red kite", "the red kite"),
    ],
)
def test_a_thing_has_the_article_that_is_spoken(thing: str, said: str) -> None:
    assert with_article(thing) == said


def test_the_choice_model_is_told_of_a_thing_with_its_article() -> None:
    task = search_task("orange kite", 4, "clockwise")
    assert task.startswith("Find the window with an orange kite on floor 4. The drone flies clockwise")
