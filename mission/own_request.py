"""A request of the customer's own in a scene whose goal was set for other words: what a claim was worth by the words.

The scene's goal says nothing of such a request, unless the words mean it.
"""

import re
from typing import NamedTuple

from contracts.orchestrator import OutcomeName
from contracts.sim import ClaimedWindow, Shown, Verdict
from mission.wording import with_article


class Judged(NamedTuple):
    """The outcome, how it is said, and the verdict as it counts."""

    outcome: OutcomeName
    message: str
    verdict: Verdict


def judged_by_words(verdict: Verdict, floor: int | None, thing: str | None) -> Judged | None:
    """Of a claim for the thing on the floor that were understood; None where the goal judges: the words mean it, or
    they are not the customer's own."""
    window = verdict.window
    if window is None or (window.goal is not None and fits(window.goal, floor, thing)):
        return None
    by_words = verdict.model_copy(
        update={
            "judged": False,
            "delivered": False,
            "right_window": None,
            **window.model_dump(include={"distance_m", "in_front", "line_of_sight", "nearest_window", "aside_deg"}),
        }
    )
    what = f"{with_article(thing or 'thing')} on floor {floor}"
    other = "; the goal of the scene itself is another" if window.goal is not None else ""
    if verdict.collided:
        return Judged("collision", "the drone collided on its way", by_words)
    if not fits(window.claimed, floor, thing):
        return Judged("wrong_window", f"claimed a window without {what}{_instead(window)}{other}", by_words)
    where = f"{window.distance_m:.1f} m from its centre"
    if by_words.stops_well():
        return Judged("stopped_not_judged", f"in front of a window with {what}, as asked, {where}{other}", by_words)
    return Judged("not_in_front", f"a window with {what}, as asked, but the stop is {where} or aside{other}", by_words)


def fits(shown: Shown, floor: int | None, thing: str | None) -> bool:
    """Whether the words may mean what stands at a window: its floor, and a name that they hold whole. A thing that is
    named without a colour may have any."""
    asked = _words(thing or "")
    return floor == shown.floor and any(
        _words(name) <= asked and asked <= _words(name) | _LOOSE for name in shown.names
    )


def _instead(window: ClaimedWindow) -> str:
    """What stands at the window claimed, by its first name."""
    names = window.claimed.names
    return f" (there is {with_article(names[0])} on floor {window.claimed.floor})" if names else ""


_LOOSE = frozenset(
    ("big", "large", "little", "small", "old", "new", "nice", "bright", "dark", "light", "a", "an", "the")
)
"""Words that tell nothing apart."""


def _words(phrase: str) -> frozenset[str]:
    return frozenset(re.findall(r"[a-z0-9]+", phrase.casefold()))
