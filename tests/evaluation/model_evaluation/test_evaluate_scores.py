"""Figures of hand-made answers about hand-made streets: what is right is known."""

from collections.abc import Sequence

import pytest

from contracts.cameras import default_rig
from contracts.geometry import Box, Pose
from contracts.orchestrator import SightingSettings
from contracts.sim import TruthView, VisibleObject
from contracts.vlm_gateway import Match
from evaluation.model_evaluation.asking import Answers, Counted, Sought
from evaluation.model_evaluation.card import card
from evaluation.model_evaluation.cases import Case, Front, RenderedLook
from evaluation.model_evaluation.heights import Told, direct_m, stepwise_m
from evaluation.model_evaluation.judged import judged
from evaluation.model_evaluation.mistakes import taken_for
from evaluation.model_evaluation.questions import Role
from evaluation.model_evaluation.scores import Scores, score

CAMERAS = default_rig().cameras
POSE = Pose(x=0, y=0, z=5, yaw=0)
LEFT, RIGHT = Box(x_min=0.1, y_min=0.4, x_max=0.2, y_max=0.6), Box(x_min=0.7, y_min=0.4, x_max=0.8, y_max=0.6)


def thing(
    kind: str, colour: str, box: Box = LEFT, *, pixels: int = 900, share: float = 1.0, distance_m: float = 6.0
) -> VisibleObject:
    return VisibleObject(
        id=f"{kind}-{colour}",
        kind=kind,
        colour=colour,
        goal=False,
        box=box,
        pixels=pixels,
        share=share,
        distance_m=distance_m,
    )


def look(*things: VisibleObject, where: str = "near") -> RenderedLook:
    truth = tuple(
        TruthView(
            camera=c.name,
            objects=things if c.name == "front" else (),
            building_box=None,
            floors_visible=0,
            floor_rows=(),
        )
        for c in CAMERAS
    )
    return RenderedLook.model_validate(
        {
            "where": where,
            "pose": POSE,
            "cameras": CAMERAS,
            "pictures": tuple(f"{c.name}.jpg" for c in CAMERAS),
            "truth": truth,
        }
    )


def front(number: int, floors: int, *, top: float | None = None, stand_off: float = 9.0) -> Front:
    truth = TruthView(
        camera="front",
        objects=(),
        building_box=Box(x_min=0, y_min=0.2, x_max=1, y_max=1),
        floors_visible=floors,
        floor_rows=(),
    )
    camera = stand_off * (2 * number - 1) if number else stand_off
    return Front(
        number=number, camera_m=camera, stand_off_m=stand_off, facade_top_m=top, picture="front.jpg", truth=truth
    )


def case(
    seed: int = 1, *looks: RenderedLook, fronts: Sequence[Front] = (), strange: bool = False, floor: int = 4
) -> Case:
    return Case(
        seed=seed,
        object="red mug",
        kind="mug",
        colour="red",
        floor=floor,
        floors=6,
        floor_height_m=3.0,
        building="low_rise",
        wall="brick",
        sky="clear",
        exposure=1.0,
        strange=strange,
        looks=looks,
        fronts=tuple(fronts),
    )


def sought(
    *matches: tuple[Box, float],
    seed: int = 1,
    at: int = 0,
    role: Role = "goal",
    what: tuple[str, str] | None = ("mug", "red"),
    outcome: str = "answered",
) -> Sought:
    return Sought.model_validate(
        {
            "seed": seed,
            "look": at,
            "role": role,
            "phrase": "a thing",
            "kind": what[0] if what else None,
            "colour": what[1] if what else None,
            "first": True,
            "outcome": outcome,
            "matches": tuple(Match(camera="front", box=box, confidence=c) for box, c in matches),
            "claim_confidence": 0.8,
            "latency_s": 0.1,
        }
    )


def scored(cases: Sequence[Case], *asked: Sought, counted: Sequence[Counted] = ()) -> Scores:
    answers = Answers(model="m-1", sought=asked, counted=tuple(counted))
    return score({c.seed: c for c in cases}, answers, SightingSettings())


def k_n(scores: Scores, name: str) -> tuple[int, int]:
    return scores.rates[name].k, scores.rates[name].n


MUG, OTHER_MUG, KETTLE = thing("mug", "red"), thing("mug", "blue", RIGHT), thing("kettle", "red", RIGHT)


def test_a_claim_on_the_thing_is_recall_and_a_candidate_counts_apart() -> None:
    scores = scored([case(1, look(MUG))], sought((LEFT, 0.9)))
    assert k_n(scores, "recall, clear") == (1, 1)
    unsure = scored([case(1, look(MUG))], sought((LEFT, 0.5)))
    assert k_n(unsure, "recall, clear") == (0, 1)
    assert k_n(unsure, "recall, clear, candidates too") == (1, 1)
    assert k_n(unsure, "tasks with a claim") == (0, 1)


@pytest.mark.parametrize(
    "hidden",
    [thing("mug", "red", pixels=199), thing("mug", "red", share=0.59), thing("mug", "red", distance_m=10.1)],
)
def test_recall_counts_only_what_is_near_large_and_uncovered_enough(hidden: VisibleObject) -> None:
    assert k_n(scored([case(1, look(hidden))], sought()), "recall, clear") == (0, 0)


def test_curves_relax_one_condition_each() -> None:
    far = scored([case(1, look(thing("mug", "red", distance_m=12)))], sought((LEFT, 0.9)))
    assert far.groups["recall by distance"]["10-14 m"].k == 1
    assert not far.groups["recall by size"]
    small = scored([case(1, look(thing("mug", "red", pixels=150)))], sought())
    assert (small.groups["recall by size"]["100-200 px"].k, small.groups["recall by size"]["100-200 px"].n) == (0, 1)
    assert not small.groups["recall by distance"]


def test_a_claim_beside_the_thing_is_wrong_and_the_decoy_in_view_is_named() -> None:
    scores = scored([case(1, look(MUG, OTHER_MUG))], sought((RIGHT, 0.9)))
    assert k_n(scores, "same class in view: wrong claims") == (1, 1)
    assert k_n(scores, "same colour in view: wrong claims") == (0, 0)
    assert k_n(scores, "wrong claims of tasks with a claim") == (1, 1)
    colour = scored([case(1, look(MUG, KETTLE))], sought((LEFT, 0.9)))
    assert k_n(colour, "same colour in view: recall") == (1, 1)
    assert k_n(colour, "same class in view: recall") == (0, 0)


def test_the_surest_claim_decides_whether_a_look_claims_wrongly() -> None:
    right_first = scored([case(1, look(MUG, OTHER_MUG))], sought((LEFT, 0.95), (RIGHT, 0.9)))
    assert k_n(right_first, "same class in view: wrong claims") == (0, 1)


def test_a_task_claims_at_the_first_look_that_does() -> None:
    street = case(1, look(where="lap"), look(MUG, where="far"), look(MUG))
    late = scored([street], sought(at=0), sought((LEFT, 0.9), at=1), sought((RIGHT, 0.9), at=2))
    assert k_n(late, "wrong claims of tasks with a claim") == (0, 1)
    early = scored([street], sought((LEFT, 0.9), at=0), sought((LEFT, 0.9), at=1))
    assert k_n(early, "wrong claims of tasks with a claim") == (1, 1)
    assert k_n(early, "looks without it, claimed") == (1, 1)


def test_unknown_things_are_to_be_refused() -> None:
    scores = scored(
        [case(1, look(MUG))],
        sought(role="unknown", what=None, outcome="refused"),
        sought((LEFT, 0.9), role="unknown", what=None),
    )
    assert k_n(scores, "unknown things: said so") == (1, 2)
    assert k_n(scores, "unknown things: claimed") == (1, 2)
    assert k_n(scores, "recall, clear") == (0, 0)


def test_strange_streets_count_in_their_own_rates_only() -> None:
    scores = scored([case(1, look(MUG)), case(2, look(MUG), strange=True)], sought((LEFT, 0.9)), sought(seed=2))
    assert k_n(scores, "recall, clear") == (1, 1)
    assert k_n(scores, "strange looks: recall, clear") == (0, 1)
    assert (scores.tasks, scores.strange) == (1, 1)


def test_a_model_whose_answer_cannot_be_read_finds_nothing_and_is_told_apart() -> None:
    scores = scored([case(1, look(MUG))], sought(outcome="unreadable"))
    assert k_n(scores, "recall, clear") == (0, 1)
    assert k_n(scores, "no readable answer") == (1, 1)


def test_heights_follow_from_the_counts_by_eq_3() -> None:
    street = case(1, fronts=(front(1, 6, top=None), front(2, 6, top=36.0), front(0, 12, top=36.0)), floor=9)
    assert stepwise_m(street, {1: Told(6), 2: Told(6)}) == pytest.approx(25.5)
    assert direct_m(street, 12) == pytest.approx(25.5)
    assert stepwise_m(street, {1: Told(6), 2: Told(None)}) is None
    assert stepwise_m(street, {1: Told(2), 2: Told(2)}) is None


def test_a_window_row_on_the_edge_of_two_bands_is_one_floor_where_rows_are_told() -> None:
    street = case(1, fronts=(front(1, 5, top=None), front(2, 5, top=36.0)), floor=9)
    windows_m = [2.0 + 4.0 * floor for floor in range(9)]
    rows = {
        n: tuple(0.5 - (z - (18 * n - 9)) / 18 for z in windows_m[::-1] if abs(z - 18 * n + 9) <= 9) for n in (1, 2)
    }
    assert [len(r) for r in rows.values()] == [5, 5]
    assert stepwise_m(street, {n: Told(5, r) for n, r in rows.items()}) == pytest.approx(34.0, abs=0.5)
    assert stepwise_m(street, {1: Told(5), 2: Told(5)}) == pytest.approx(30.6)


def test_floor_failures_are_heights_more_than_seven_metres_off() -> None:
    street = case(1, fronts=(front(1, 6, top=18.0), front(0, 6, top=18.0)), floor=4)
    told = [Counted(seed=1, front=0, floors=6, box=None), Counted(seed=1, front=1, floors=24, box=None)]
    scores = scored([street], counted=told)
    assert k_n(scores, "floors: exact") == (1, 1)
    assert k_n(scores, "floors: stepwise failures") == (0, 1)
    assert k_n(scores, "floors: direct-count failures") == (1, 1)


def test_the_card_says_what_was_missed_and_what_was_taken_for_what() -> None:
    street = case(1, look(MUG, OTHER_MUG))
    scores = scored([street], sought((RIGHT, 0.9)))
    held = judged({1: street}, Answers(model="m-1", sought=(sought((RIGHT, 0.9)),), counted=()), SightingSettings())
    mistaken = taken_for(held)
    assert mistaken == [("red mug", "a blue mug", 1)]
    page = card(scores, mistaken, [], ("a.png", "b.png"), {"figures": {"top_1": 0.5}})
    assert "| recall within 10 m, ≥ 60 % and ≥ 200 px visible | ≥ 95 % | 0/1" in page
    assert "missed" in page
    assert "| red mug | a blue mug | 1 |" in page
    assert "| top 1 | 0.5 |" in page
