"""The choice alone: is the marked point chosen from which the remaining way is shortest?"""

from collections.abc import Sequence
from typing import NamedTuple

from contracts.geometry import PointLabel
from evaluation.subtasks.figures import Figures, by_group, mean, rate

TIE_M = 0.25
"""Points whose remaining ways differ by no more than this are equally good."""


class Choice(NamedTuple):
    """One question: the remaining way (metres) from the end of each point that was offered, at least one of them
    finite; the model's label, null where the answer was none of them."""

    remaining_m: dict[PointLabel, float | None]
    label: PointLabel | None


def score(choices: Sequence[Choice]) -> Figures:
    """`agrees`: the chosen point's way is the shortest; `centre_agrees`: what always taking the centre would have
    got (a centre that is not offered counts as wrong); `chance`: what a blind draw would get on average.
    `regret_m`: how much longer the chosen way is, over answers. Null without questions."""
    return Figures(
        rates={
            "agrees": rate(agrees(choice, choice.label) for choice in choices),
            "centre_agrees": rate(agrees(choice, "c") for choice in choices),
        },
        values={
            "chance": mean([_chance(choice) for choice in choices]),
            "regret_m": mean([r for choice in choices if (r := regret_m(choice)) is not None]),
        },
        groups={
            "agrees by points offered": by_group(
                (f"{len(choice.remaining_m)} points", agrees(choice, choice.label)) for choice in choices
            )
        },
    )


def agrees(choice: Choice, label: PointLabel | None) -> bool:
    """That point's remaining way is the shortest, ties included."""
    way = choice.remaining_m.get(label) if label is not None else None
    return way is not None and way <= _shortest_m(choice) + TIE_M


def regret_m(choice: Choice) -> float | None:
    """Metres over the shortest; null without a point, or where none leads on from it."""
    way = choice.remaining_m.get(choice.label) if choice.label is not None else None
    return None if way is None else way - _shortest_m(choice)


def _shortest_m(choice: Choice) -> float:
    return min(way for way in choice.remaining_m.values() if way is not None)


def _chance(choice: Choice) -> float:
    return sum(agrees(choice, label) for label in choice.remaining_m) / len(choice.remaining_m)
