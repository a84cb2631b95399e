"""`logisticsvln compare`: arms side by side, each tested against the first on the tasks that both flew."""

from collections.abc import Sequence

from contracts.base import Wire
from evaluation.metrics.summary import Change, Comparison, Rate, Summary
from evaluation.report.markup import p_value, percent
from evaluation.report.runs import Run
from evaluation.report.tables import against

HEADS = (
    "arm",
    "success",
    "SPL",
    "steps",
    "floor fails",
    "wrong claims",
    "collisions",
    "only it : only the first",
    "p success",
    "SPL gained",
    "p SPL",
)


class Arm(Wire):
    """One run; `against_first` is null for the first itself. In it the run comes first and the first run second, so
    that a positive difference is this run's gain."""

    label: str
    folder: str
    summary: Summary
    against_first: Comparison | None


class Arms(Wire):
    """What `compare --json` prints."""

    arms: tuple[Arm, ...]


def compared(runs: Sequence[Run]) -> Arms:
    """The first run is what the others are tested against. Raises ValueError for one run alone, and where a run shares
    no task with the first."""
    if len(runs) < 2:
        raise ValueError("a comparison needs two runs or more, the first of which the others are tested against")
    first, *others = runs
    arms = [_arm(first, None)]
    for run in others:
        test = against(run, first)
        if not test.tasks:
            raise ValueError(f"{run.folder} and {first.folder} have no task in common that both have flown")
        arms.append(_arm(run, test))
    return Arms(arms=tuple(arms))


def _arm(run: Run, test: Comparison | None) -> Arm:
    return Arm(label=run.label, folder=str(run.folder), summary=run.summary, against_first=test)


def cells(arm: Arm) -> tuple[str, ...]:
    """One arm's row under `HEADS`."""
    own, test = arm.summary, arm.against_first
    figures = (
        arm.label,
        rate(own.success),
        percent(own.spl.horizontal),
        "n/a" if own.average_steps is None else f"{own.average_steps:.1f}",
        rate(own.floor_fail),
        rate(own.recognition_fail),
        str(own.collisions),
    )
    if test is None:
        return (*figures, "", "", "", "")
    tests = (f"{test.only_first} : {test.only_second}", p_value(test.success_p), change(test.spl), p_value(test.spl.p))
    return figures + tests


def rate(found: Rate) -> str:
    """`k/n p % (low-high)`."""
    if found.rate is None or found.low is None or found.high is None:
        return f"{found.k}/{found.n}"
    return f"{found.k}/{found.n} {percent(found.rate)} % ({percent(found.low)}–{percent(found.high)})"


def change(found: Change) -> str:
    """In points, with the interval."""
    if found.mean is None:
        return "n/a"
    mean = f"{100 * found.mean:+.1f}"
    if found.low is None or found.high is None:
        return mean
    return f"{mean} ({100 * found.low:+.1f} to {100 * found.high:+.1f})"
