"""Each subtask's figures, by hand on small cases; and what each says of no questions at all."""

import pytest

from contracts.geometry import Box
from contracts.sim import TruthView, VisibleObject
from contracts.vlm_gateway import Match
from evaluation.subtasks import choice, floors, parse, recognition
from evaluation.subtasks.choice import Choice
from evaluation.subtasks.figures import bin_of
from evaluation.subtasks.floors import Count
from evaluation.subtasks.parse import Parsed
from evaluation.subtasks.recognition import JudgedLook
from tests.cameras import NAMES

BOX = Box(x_min=0.4, y_min=0.4, x_max=0.5, y_max=0.5)
ELSEWHERE = Box(x_min=0.8, y_min=0.1, x_max=0.9, y_max=0.2)


def thing(
    goal: bool = True,
    kind: str = "vase",
    colour: str = "blue",
    share: float = 1.0,
    pixels: int = 500,
    away: float = 7.0,
) -> VisibleObject:
    name = f"{kind}-{colour}-{goal}"
    return VisibleObject(
        id=name, kind=kind, colour=colour, goal=goal, box=BOX, pixels=pixels, share=share, distance_m=away
    )


def view(*things: VisibleObject, heading: int = 0) -> TruthView:
    return TruthView(camera=NAMES[heading], objects=things, building_box=None, floors_visible=0, floor_rows=())


def match(box: Box = BOX, heading: int = 0) -> Match:
    return Match(camera=NAMES[heading], box=box)


def look(*views: TruthView, matches: tuple[Match, ...] | None = ()) -> JudgedLook:
    return JudgedLook("vase", "blue", views, matches)


@pytest.mark.parametrize(
    ("shown", "as_what"),
    [
        (thing(), "shown"),
        (thing(share=0.3), "covered"),
        (thing(pixels=79), "faint"),
        (thing(away=25.1), "faint"),
        (thing(goal=False), "absent"),
    ],
)
def test_a_look_is_shown_covered_faint_or_absent(shown: VisibleObject, as_what: str) -> None:
    assert recognition.shows(look(view(shown))) == as_what


def test_recall_counts_matches_on_the_goal_in_the_right_view_only() -> None:
    looks = [
        look(view(thing()), matches=(match(),)),
        look(view(thing()), matches=(match(ELSEWHERE), match())),
        look(view(thing()), view(heading=45), matches=(match(heading=45),)),
        look(view(thing()), matches=None),
    ]
    rates = recognition.score(looks).rates
    assert (rates["recall"].k, rates["recall"].n) == (2, 4)
    assert (rates["recall_first"].k, rates["recall_first"].n) == (1, 4)
    assert rates["false_claim"].n == 0


def test_false_claims_are_told_apart_by_the_decoy_in_view() -> None:
    claim = (match(ELSEWHERE),)
    looks = [
        look(view(thing(False, colour="red")), matches=claim),
        look(view(thing(False, kind="lamp")), matches=()),
        look(view(thing(False, colour="red"), thing(False, kind="lamp")), matches=claim),
        look(view(thing(False), thing(False, kind="lamp")), matches=claim),
        look(view(thing(False, colour="red", pixels=20)), matches=()),
    ]
    figures = recognition.score(looks)
    assert (figures.rates["false_claim"].k, figures.rates["false_claim"].n) == (3, 5)
    groups = figures.groups["false claims by decoy in view"]
    assert {name: (r.k, r.n) for name, r in groups.items()} == {
        "same thing": (1, 1),
        "same class": (2, 2),
        "same colour": (1, 2),
        "neither": (0, 1),
    }


def test_recall_falls_into_bins_by_the_view_that_shows_most() -> None:
    looks = [
        look(view(thing(away=4.0, pixels=4000)), view(thing(away=4.1, pixels=100), heading=45), matches=(match(),)),
        look(view(thing(away=12.0, pixels=150, share=0.5)), matches=()),
        look(view(thing(share=0.2)), matches=(match(),)),
    ]
    groups = recognition.score(looks).groups
    assert {k: (r.k, r.n) for k, r in groups["recall by distance"].items()} == {"< 5 m": (1, 1), "10-15 m": (0, 1)}
    assert {k: (r.k, r.n) for k, r in groups["recall by size"].items()} == {"< 200 px": (0, 1), "> 3200 px": (1, 1)}
    assert {k: (r.k, r.n) for k, r in groups["recall by visible share"].items()} == {
        "< 40 %": (1, 1),
        "40-70 %": (0, 1),
        "> 95 %": (1, 1),
    }


def test_floor_counts_without_an_answer_are_wrong_but_have_no_error() -> None:
    figures = floors.score(
        [Count(5, 5, "villa"), Count(5, 6, "villa"), Count(4, 1, "villa"), Count(3, None, "cultural")]
    )
    assert (figures.rates["exact"].k, figures.rates["within_one"].k, figures.rates["exact"].n) == (1, 2, 4)
    assert figures.values["mean_error"] == pytest.approx(-2 / 3, abs=1e-4)
    assert figures.values["mean_absolute_error"] == pytest.approx(4 / 3, abs=1e-4)
    assert figures.groups["exact by building"]["cultural"].n == 1


def test_a_choice_agrees_with_the_shortest_remaining_way_ties_included() -> None:
    choices = [
        Choice({"a": 30.0, "c": 20.0, "e": 20.2}, "e"),
        Choice({"a": 30.0, "c": 20.0}, "a"),
        Choice({"b": 10.0, "d": None}, "d"),
        Choice({"b": 10.0, "c": 12.0}, None),
    ]
    figures = choice.score(choices)
    assert (figures.rates["agrees"].k, figures.rates["agrees"].n) == (1, 4)
    assert figures.rates["centre_agrees"].k == 2
    assert figures.values["regret_m"] == pytest.approx((0.2 + 10.0) / 2)
    assert figures.values["chance"] == pytest.approx((2 / 3 + 1 / 2 + 1 / 2 + 1 / 2) / 4, abs=1e-4)


def test_parsing_is_exact_but_for_case_blanks_and_hyphens() -> None:
    figures = parse.score(
        [
            Parsed("plain", 4, "blue vase", 4, "Blue-vase"),
            Parsed("plain", 4, "blue vase", 4, "vase"),
            Parsed("chatty", 4, "blue vase", None, "blue vase"),
            Parsed("chatty", 4, "blue vase", None, None),
        ]
    )
    assert {name: r.k for name, r in figures.rates.items()} == {"floor": 2, "object": 2, "both": 1}
    assert {name: (r.k, r.n) for name, r in figures.groups["both by style"].items()} == {
        "plain": (1, 2),
        "chatty": (0, 2),
    }


def test_without_questions_there_are_no_figures_but_also_no_errors() -> None:
    for figures in (recognition.score([]), floors.score([]), choice.score([]), parse.score([])):
        assert all(rate.n == 0 and rate.rate is None for rate in figures.rates.values())
        assert all(value is None for value in figures.values.values())
        assert all(group == {} for group in figures.groups.values())


def test_the_last_bin_takes_whatever_is_larger() -> None:
    bins = {"small": 1.0, "large": 2.0}
    assert [bin_of(value, bins) for value in (0.5, 1.0, 9.0)] == ["small", "large", "large"]
