"""`logisticsvln compare`: arms side by side, each tested against the first on the tasks that both flew."""

from collections import defaultdict
from collections.abc import Mapping, Sequence

from contracts.base import Wire
from evaluation.metrics.comparison import Change, Comparison, compare
from evaluation.metrics.summary import Rate, Summary
from evaluation.report.markup import p_value, percent
from evaluation.report.runs import Run

HEADS = (
    "arm",
    "success",
    "SPL horizontal",
    "SPL spatial",
    "steps",
    "floor off by 7 m",
    "by half a floor",
    "wrong claims",
    "collisions",
    "infrastructure",
    "only it : only the first",
    "p success",
    "horizontal SPL gained",
    "p horizontal SPL",
    "spatial SPL gained",
    "p spatial SPL",
)


class Arm(Wire):
    """One run; `against_first` is null for the first itself, which is the baseline of all others."""

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


def against(run: Run, baseline: Run) -> Comparison:
    """The paired tests on the tasks that both flew. Tasks are the same where all but their names is: sets that were
    drawn from one seed under two names are one set, and of two seeds none is shared, whatever they are called."""
    same = same_tasks(run.contents, baseline.contents)
    tasks = {name: run.tasks[name] for name in same.values()}
    return compare(
        tasks,
        [record for record in run.records if record.task in tasks],
        [r.model_copy(update={"task": same[r.task]}) for r in baseline.records if r.task in same],
    )


def same_tasks(run: Mapping[str, str], baseline: Mapping[str, str]) -> dict[str, str]:
    """The run's name of each of the baseline's tasks that is in both. Both map names to contents. Where a set holds a
    task several times, equal names go together, and the others in their order."""
    names: defaultdict[str, list[str]] = defaultdict(list)
    for name, content in run.items():
        names[content].append(name)
    pairs = {name: name for name, content in baseline.items() if run.get(name) == content}
    for name in pairs:
        names[baseline[name]].remove(name)
    for name, content in baseline.items():
        if name not in pairs and names[content]:
            pairs[name] = names[content].pop(0)
    return pairs


def _arm(run: Run, test: Comparison | None) -> Arm:
    return Arm(label=run.label, folder=str(run.folder), summary=run.summary, against_first=test)


def cells(arm: Arm) -> tuple[str, ...]:
    """One arm's row under `HEADS`."""
    own, test = arm.summary, arm.against_first
    figures = (
        arm.label,
        rate(own.success),
        percent(own.spl.horizontal),
        percent(own.spl.spatial),
        "n/a" if own.average_steps is None else f"{own.average_steps:.1f}",
        rate(own.floor_fail),
        rate(own.floor_fail_half_floor),
        rate(own.recognition_fail),
        str(own.collisions),
        f"{own.infrastructure} of {own.tasks}" if own.infrastructure else "0",
    )
    if test is None:
        return (*figures, *[""] * (len(HEADS) - len(figures)))
    return (
        *figures,
        f"{test.only_run} : {test.only_baseline}",
        p_value(test.success_p),
        change(test.horizontal_spl),
        p_value(test.horizontal_spl_p),
        change(test.spatial_spl),
        p_value(test.spatial_spl_p),
    )


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
