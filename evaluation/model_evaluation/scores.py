"""The figures of one model on the evaluation's pictures; every rate with its own denominator."""

from collections.abc import Callable, Mapping, Sequence

from contracts.base import Wire
from contracts.orchestrator import SightingSettings
from contracts.sim import VisibleObject
from evaluation.metrics.model_calls import Latency, latency
from evaluation.metrics.summary import Rate
from evaluation.model_evaluation.asking import Answers
from evaluation.model_evaluation.cases import Case
from evaluation.model_evaluation.heights import heights
from evaluation.model_evaluation.judged import Judged, judged
from evaluation.model_evaluation.questions import CLEAR_PIXELS, CLEAR_SHARE, NEAR_M
from evaluation.subtasks.figures import bin_of, by_group, rate

DISTANCES = {"< 4 m": 4.0, "4-7 m": 7.0, "7-10 m": 10.0, "10-14 m": 14.0, "14-20 m": 20.0, "> 20 m": float("inf")}
SIZES = {
    "40-100 px": 100.0,
    "100-200 px": 200.0,
    "200-400 px": 400.0,
    "400-1000 px": 1000.0,
    "1000-4000 px": 4000.0,
    "> 4000 px": float("inf"),
}
SHARES = {"20-40 %": 0.4, "40-60 %": 0.6, "60-80 %": 0.8, "80-95 %": 0.95, "> 95 %": float("inf")}
CONFIDENCES = {f"{k / 10:.1f}-{(k + 1) / 10:.1f}": (k + 1) / 10 for k in range(9)} | {"0.9-1.0": float("inf")}
FEWEST_PIXELS, LEAST_SHARE = 40, 0.2
Shown = Callable[[VisibleObject], bool]


class Scores(Wire):
    """What `docs/model-card.md` is made of. `tasks` are the streets that look like those trained on; `strange` ones
    look as nothing in the training does, and count in their own rates only. `sightings` said what counts as a claim."""

    model: str | None
    sightings: SightingSettings
    tasks: int
    strange: int
    questions: int
    rates: dict[str, Rate]
    values: dict[str, float | None]
    groups: dict[str, dict[str, Rate]]
    first_look_s: Latency
    next_phrase_s: Latency
    floor_count_s: Latency


def score(cases: Mapping[int, Case], answers: Answers, settings: SightingSettings) -> Scores:
    """Raises KeyError for an answer about a street that isn't there."""
    held = judged(cases, answers, settings)
    usual = [j for j in held if not j.case.strange]
    strange = [j for j in held if j.case.strange]
    floors = heights(cases, answers)
    known = [j for j in usual if j.asked.role != "unknown"]
    clear = [j for j in known if j.clear]
    absent = [j for j in known if not j.shown]
    twins = [j for j in known if j.decoys[0]]
    namesakes = [j for j in known if j.decoys[1]]
    claims = first_claims(usual)
    return Scores(
        model=answers.model,
        sightings=settings,
        tasks=sum(not case.strange for case in cases.values()),
        strange=sum(case.strange for case in cases.values()),
        questions=len(answers.sought) + 2 * len(answers.counted),
        rates={
            "wrong claims of tasks with a claim": rate(not right for right in claims),
            "tasks with a claim": _of(len(claims), sum(j.asked.look == 0 and j.asked.role == "goal" for j in usual)),
            "recall, clear": rate(j.found for j in clear),
            "recall, clear, candidates too": rate(j.noticed for j in clear),
            "recall, clear goals only": rate(j.found for j in clear if j.asked.role == "goal"),
            "looks without it, claimed": rate(bool(j.claims) for j in absent),
            "looks without it, candidates": rate(bool(j.candidates) for j in absent),
            "wrong claims of all claims": rate(j.claims_wrongly for j in known if j.claims),
            "same class in view: recall": rate(j.found for j in twins if j.clear),
            "same class in view: wrong claims": rate(j.claims_wrongly for j in twins),
            "same colour in view: recall": rate(j.found for j in namesakes if j.clear),
            "same colour in view: wrong claims": rate(j.claims_wrongly for j in namesakes),
            "unknown things: said so": rate(j.asked.outcome == "refused" for j in usual if j.asked.role == "unknown"),
            "unknown things: claimed": rate(bool(j.claims) for j in usual if j.asked.role == "unknown"),
            "known things: said to be unknown": rate(j.asked.outcome == "refused" for j in known),
            "no readable answer": rate(j.asked.outcome not in ("answered", "refused") for j in usual),
            **{f"floors: {name}": r for name, r in floors.usual.items()},
            "strange looks: recall, clear": rate(j.found for j in strange if j.clear),
            "strange looks: recall, candidates too": rate(j.noticed for j in strange if j.clear),
            "strange looks without it, claimed": rate(
                bool(j.claims) for j in strange if not j.shown and j.asked.role != "unknown"
            ),
            **{f"strange looks, floors: {name}": r for name, r in floors.strange.items()},
        },
        values={"building box, mean overlap of rows": floors.box_overlap},
        groups={
            "recall by distance": _recall(
                known, lambda t: bin_of(t.distance_m, DISTANCES), DISTANCES, _large, _uncovered
            ),
            "recall by size": _recall(known, lambda t: bin_of(t.pixels, SIZES), SIZES, _near, _uncovered),
            "recall by visible share": _recall(known, lambda t: bin_of(t.share, SHARES), SHARES, _near, _large),
            "right of sightings by confidence": by_group(
                ((bin_of(m.confidence, CONFIDENCES), j.right(m)) for j in known for m in j.asked.matches[:1]),
                list(CONFIDENCES),
            ),
            "recall by kind, clear": by_group((j.asked.kind or "", j.found) for j in clear),
            "recall by colour, clear": by_group((j.asked.colour or "", j.found) for j in clear),
            "recall by light, clear": by_group((j.case.sky, j.found) for j in clear),
            "wrong claims by question": by_group((j.asked.role, j.claims_wrongly) for j in usual),
            "floors exact by building": floors.by_building,
        },
        first_look_s=latency([j.asked.latency_s for j in usual if j.asked.first]),
        next_phrase_s=latency([j.asked.latency_s for j in usual if not j.asked.first]),
        floor_count_s=latency([c.latency_s for c in answers.counted]),
    )


def first_claims(held: Sequence[Judged]) -> list[bool]:
    """Of each task the first look, in the order of a mission's, in which the goal is claimed: is the claim right?"""
    first: dict[int, Judged] = {}
    for j in sorted((j for j in held if j.asked.role == "goal" and j.claims), key=lambda j: -j.asked.look):
        first[j.case.seed] = j
    return [not j.claims_wrongly for _, j in sorted(first.items())]


def _recall(
    held: Sequence[Judged], name: Callable[[VisibleObject], str], order: Mapping[str, float], *conditions: Shown
) -> dict[str, Rate]:
    """Of what shows at all and meets the conditions, in its best view."""
    visible = [
        (j, j.best)
        for j in held
        if j.best is not None and j.best.pixels >= FEWEST_PIXELS and j.best.share >= LEAST_SHARE
    ]
    return by_group(((name(best), j.found) for j, best in visible if all(c(best) for c in conditions)), list(order))


def _near(thing: VisibleObject) -> bool:
    return thing.distance_m <= NEAR_M


def _large(thing: VisibleObject) -> bool:
    return thing.pixels >= CLEAR_PIXELS


def _uncovered(thing: VisibleObject) -> bool:
    return thing.share >= CLEAR_SHARE


def _of(k: int, n: int) -> Rate:
    return rate([True] * k + [False] * (n - k))
