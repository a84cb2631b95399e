"""Floor counting alone: how many floors does one picture show?"""

from collections.abc import Sequence
from typing import NamedTuple

from evaluation.subtasks.figures import Figures, by_group, mean, rate


class Count(NamedTuple):
    """One question: the floors in the picture, the model's number (null: no readable answer), the building's kind."""

    truth: int
    floors: int | None
    building: str


def score(counts: Sequence[Count]) -> Figures:
    """`exact` and `within_one` over all questions; the errors (counted - true) over those with a number, null
    without one."""
    errors = [count.floors - count.truth for count in counts if count.floors is not None]
    return Figures(
        rates={
            "exact": rate(count.floors == count.truth for count in counts),
            "within_one": rate(count.floors is not None and abs(count.floors - count.truth) <= 1 for count in counts),
        },
        values={"mean_error": mean(errors), "mean_absolute_error": mean([abs(error) for error in errors])},
        groups={
            "exact by building": by_group((count.building, count.floors == count.truth) for count in counts),
            "exact by floors in view": by_group(
                (f"{count.truth:2d} floor{'s' * (count.truth != 1)}", count.floors == count.truth) for count in counts
            ),
        },
    )
