"""The model card: figures against what was asked for, misses said plainly, and what the model does badly."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from evaluation.metrics.summary import Rate
from evaluation.model_evaluation.drawing import Tile
from evaluation.model_evaluation.scores import Scores
from evaluation.report.runs import Run

WORST_KINDS = 8
FEWEST_OF_A_KIND = 5


class Goal(NamedTuple):
    """A figure that was asked for: at most, or at least, `share`."""

    rate: str
    said: str
    share: float
    at_most: bool


GOALS = (
    Goal("wrong claims of tasks with a claim", "wrong claims, of tasks with a claim", 0.05, True),
    Goal("recall, clear", "recall within 10 m, ≥ 60 % and ≥ 200 px visible", 0.95, False),
    Goal("floors: stepwise failures", "floor localisation failures, stepwise", 0.03, True),
)


def card(
    scores: Scores,
    mistaken: Sequence[tuple[str, str, int]],
    tiles: Sequence[Tile],
    pictures: tuple[str, str],
    about: Mapping[str, Any],
    flown: Sequence[Run] = (),
) -> str:
    """The page. `pictures`: the file names of the curves and of the sheet; `about`: what the gateway says of the model;
    `flown`: whole deliveries."""
    parts = [
        f"# Model card: {scores.model or 'no model answered'}\n",
        "Made by `logisticsvln evaluate`, not by hand.\n",
        _what(about),
        "## Figures\n",
        _goals(scores, flown),
        f"![Recall, calibration, wrong claims, floors]({pictures[0]})\n",
        _objects(scores),
        _floors(scores),
        _flown(flown),
        _speed(scores, about),
        "## What it does badly\n",
        _badly(scores, mistaken, tiles, pictures[1]),
        _method(scores),
        _trained(about),
    ]
    return "\n".join(part for part in parts if part)


def _what(about: Mapping[str, Any]) -> str:
    size = about.get("megabytes")
    if not isinstance(size, int | float):
        return ""
    return (
        "A small text-conditioned vision model that ships with the project: one network proposes where something is "
        "and where building, windows and floors are, a second names what stands there. Pixels and text in, nothing of "
        f"the scene. It runs on ONNX Runtime, one thread; {size:.1f} MB of weights.\n"
    )


def _goals(scores: Scores, flown: Sequence[Run]) -> str:
    rows = ["| figure | asked for | measured | |", "|---|---|---|---|"]
    for goal in GOALS:
        rate = scores.rates[goal.rate]
        bound = f"{'≤' if goal.at_most else '≥'} {100 * goal.share:.0f} %"
        rows.append(f"| {goal.said} | {bound} | {told(rate)} | {_verdict(rate, goal)} |")
    stepwise, direct = scores.rates["floors: stepwise failures"], scores.rates["floors: direct-count failures"]
    better = (stepwise.rate or 0.0) < (direct.rate or 0.0)
    rows.append(
        f"| stepwise fails less than direct count | yes | {told(direct)} direct | {'met' if better else 'missed'} |"
    )
    rows += [f"| deliveries, {run.label} | | {told(run.summary.success)} | |" for run in flown]
    return "\n".join(rows) + "\n"


def _verdict(rate: Rate, goal: Goal) -> str:
    if rate.rate is None or rate.low is None or rate.high is None:
        return "not measured"
    met = rate.rate <= goal.share if goal.at_most else rate.rate >= goal.share
    sure = (rate.high <= goal.share if goal.at_most else rate.low >= goal.share) == met
    doubt = ", but the interval reaches beyond" if met else ", but the interval reaches it"
    return ("met" if met else "missed") + ("" if sure else doubt)


def _objects(scores: Scores) -> str:
    names = {
        "recall, clear goals only": "recall of clear goals alone",
        "recall, clear, candidates too": "recall, with what would be looked at again",
        "wrong claims of all claims": "wrong claims of all claims, over all questions",
        "looks without it, claimed": "looks that don't show the thing: claimed all the same",
        "looks without it, candidates": "looks that don't show the thing: a nearer look would be taken",
        "same class in view: recall": "another of the same class in view: recall",
        "same class in view: wrong claims": "another of the same class in view: wrong claims",
        "same colour in view: recall": "something else of the same colour in view: recall",
        "same colour in view: wrong claims": "something else of the same colour in view: wrong claims",
        "unknown things: said so": "things outside the vocabulary: said so",
        "unknown things: claimed": "things outside the vocabulary: claimed",
        "known things: said to be unknown": "things of the vocabulary said to be unknown",
        "strange looks: recall, clear": "looks never trained on: recall",
        "strange looks: recall, candidates too": "looks never trained on: recall, with candidates",
        "strange looks without it, claimed": "looks never trained on, without the thing: claimed",
    }
    return _table("objects", {said: scores.rates[name] for name, said in names.items()})


def _floors(scores: Scores) -> str:
    names = {name: rate for name, rate in scores.rates.items() if "floors: " in name}
    overlap = scores.values["building box, mean overlap of rows"]
    said = "n/a" if overlap is None else f"{overlap:.3f}"
    return (
        _table("floors, squarely from the bands of eq. 3", names)
        + f"\nThe building's box: mean overlap of rows {said}.\n"
    )


def _flown(flown: Sequence[Run]) -> str:
    if not flown:
        return ""
    rows = [
        "| deliveries | delivered | wrong claims | floor failures | steps | collisions |",
        "|---|---|---|---|---|---|",
    ]
    for run in flown:
        s = run.summary
        steps = "n/a" if s.average_steps is None else f"{s.average_steps:.1f}"
        cells = [run.label, told(s.success), told(s.recognition_fail), told(s.floor_fail), steps, str(s.collisions)]
        rows.append(f"| {' | '.join(cells)} |")
    return "\n".join(rows) + "\n"


def _speed(scores: Scores, about: Mapping[str, Any]) -> str:
    def ms(seconds: float | None) -> str:
        return "n/a" if seconds is None else f"{1000 * seconds:.0f} ms"

    a, b, c = scores.first_look_s, scores.next_phrase_s, scores.floor_count_s
    return (
        f"In the gateway, on the machine that made this page: five views {ms(a.p50)} (95th percentile {ms(a.p95)}), "
        f"another phrase about the same views {ms(b.p50)}, a floor count {ms(c.p50)}. `make bench-model` compares it "
        "with the rendering of the same views.\n"
    )


def _badly(scores: Scores, mistaken: Sequence[tuple[str, str, int]], tiles: Sequence[Tile], sheet: str) -> str:
    parts = []
    kinds = {k: r for k, r in scores.groups["recall by kind, clear"].items() if r.n >= FEWEST_OF_A_KIND}
    worst = sorted(kinds.items(), key=lambda item: item[1].rate or 0.0)[:WORST_KINDS]
    parts.append(_table("classes it finds least", {k.replace("_", " "): r for k, r in worst}))
    if mistaken:
        rows = ["| asked for | claimed instead | times |", "|---|---|---:|"]
        rows += [f"| {asked.replace('_', ' ')} | {claimed} | {n} |" for asked, claimed, n in mistaken[:12]]
        parts.append("\n".join(rows) + "\n")
    if tiles:
        parts.append(f"![Mistakes: green is what was asked for, red what was claimed]({sheet})\n")
        rows = ["| | asked | what happened |", "|---:|---|---|"]
        rows += [f"| {k} | {tile.title} | {tile.note} |" for k, tile in enumerate(tiles, 1)]
        parts.append("\n".join(rows) + "\n")
    return "\n".join(parts)


def _method(scores: Scores) -> str:
    s = scores.sightings
    threshold = "the model's own" if s.claim_confidence is None else f"{s.claim_confidence:g}"
    return f"""## How it was measured

{scores.tasks} streets of the seeds from 100,000, which training never sees, and {scores.strange} more with concrete
walls at dusk, under- or overexposed, which training leaves out as looks. In each: five views on the lap, five from 10
to 20 m and five from 3.5 to 10 m before the goal's window, and squarely every band of eq. 3 and the whole building.
Asked for: the goal, other things that show, the same class in a colour that isn't there, the same colour on a class
that isn't there, and what no catalogue has; half of it in synonyms. {scores.questions} questions over HTTP, no answer
from a cache.

A claim is a match of at least the claim's confidence ({threshold}); a candidate one of at least
{s.candidate_confidence:g}. A claim is right when its middle lies in the box of such a thing, grown by a quarter. A
task's claim is the first one in the order lap, far, near; in flight a candidate is looked at again from nearer before
anything is claimed. Floor heights follow from eq. 3 and the window rows, as in a mission that flies without error. No
threshold and no calibration is chosen on these streets. Intervals are Wilson's, 95 %.
"""


def _trained(about: Mapping[str, Any]) -> str:
    figures = about.get("figures")
    if not isinstance(figures, Mapping) or not figures:
        return ""
    rows = ["## Training\n", "| figure | |", "|---|---:|"]
    rows += [f"| {str(name).replace('_', ' ')} | {value:g} |" for name, value in figures.items()]
    return "\n".join(rows) + "\n"


def _table(title: str, rates: Mapping[str, Rate]) -> str:
    rows = [f"| {title} | |", "|---|---|"]
    return "\n".join([*rows, *(f"| {name} | {told(rate)} |" for name, rate in rates.items())]) + "\n"


def told(rate: Rate) -> str:
    """k/n, the share and its interval."""
    if rate.rate is None or rate.low is None or rate.high is None:
        return f"{rate.k}/{rate.n}"
    return f"{rate.k}/{rate.n}, {100 * rate.rate:.1f} % [{100 * rate.low:.1f}, {100 * rate.high:.1f}]"
