"""`logisticsvln compare --by`: runs side by side, each kind of task apart."""

from collections.abc import Sequence

from contracts.base import Wire
from evaluation.metrics.breakdown import GROUPINGS, GroupingName
from evaluation.metrics.summary import Rate, Spl, summarize
from evaluation.report.comparison import rate
from evaluation.report.markup import percent
from evaluation.report.runs import Run


class GroupFigures(Wire):
    """One run's tasks of one group. SPL 0..1, `ideal_lap_spl` horizontal, `steps` on average; null where nothing
    tells."""

    success: Rate
    spl: Spl
    ideal_lap_spl: float | None
    steps: float | None


class GroupedRun(Wire):
    label: str
    folder: str
    groups: dict[str, GroupFigures]


class GroupedRuns(Wire):
    """What `compare --by NAME --json` prints."""

    by: GroupingName
    runs: tuple[GroupedRun, ...]


def grouped(runs: Sequence[Run], by: GroupingName) -> GroupedRuns:
    """Groups in their own order. Raises ValueError for no run at all."""
    if not runs:
        raise ValueError("there is no run whose tasks could be grouped")
    return GroupedRuns(by=by, runs=tuple(_grouped(run, by) for run in runs))


def _grouped(run: Run, by: GroupingName) -> GroupedRun:
    of = GROUPINGS[by].of
    groups = {}
    for name in getattr(run.summary.groups, by):
        tasks = {key: task for key, task in run.tasks.items() if of(task) == name}
        found = summarize(tasks, [record for record in run.records if record.task in tasks], 0.0)
        groups[name] = GroupFigures(
            success=found.success,
            spl=found.spl,
            ideal_lap_spl=found.ideal_lap_spl,
            steps=found.average_steps,
        )
    return GroupedRun(label=run.label, folder=str(run.folder), groups=groups)


def heads(found: GroupedRuns) -> tuple[str, ...]:
    return found.by, *(run.label for run in found.runs)


def rows(found: GroupedRuns) -> list[tuple[str, ...]]:
    """A line a group: success with its interval, both SPL, the ideal lap's beside them, steps."""
    names = dict.fromkeys(name for run in found.runs for name in run.groups)
    return [(name, *(_cell(run.groups.get(name)) for run in found.runs)) for name in names]


def _cell(figures: GroupFigures | None) -> str:
    if figures is None:
        return ""
    steps = "" if figures.steps is None else f", {figures.steps:.1f} steps"
    spl = f"SPL horizontal {percent(figures.spl.horizontal)} of {percent(figures.ideal_lap_spl)}"
    return f"{rate(figures.success)}, {spl}, spatial {percent(figures.spl.spatial)}{steps}"
