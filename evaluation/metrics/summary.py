"""A run in figures: the one object that `--json` prints and `summary.json` holds."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import get_args

from contracts.base import Name, Wire
from evaluation.metrics.breakdown import GROUPINGS, breakdown
from evaluation.metrics.collisions import collisions
from evaluation.metrics.coverage import Absence, absence
from evaluation.metrics.episode import EpisodeRecord, Reason
from evaluation.metrics.extension import Figure, extension_figures
from evaluation.metrics.floor_localization import floor_fail_rate, half_floor_fail_rate
from evaluation.metrics.ideal_lap import ideal_lap_spl
from evaluation.metrics.model_calls import RoleCalls, model_calls
from evaluation.metrics.proportion import Proportion
from evaluation.metrics.spl import Flown, spl
from evaluation.metrics.success import average_steps, recognition_fail_rate, success_curve, success_rate
from evaluation.task_set.task import Task


class Rate(Wire):
    """k of n with its Wilson 95 % interval; `rate`, `low` and `high` (0..1) are null where n is 0."""

    k: int
    n: int
    rate: float | None
    low: float | None
    high: float | None


class Spl(Wire):
    """Success weighted by path length, 0..1, over all tasks: the ground plan's way, and the way in space."""

    horizontal: float | None
    spatial: float | None


class RadiusPoint(Wire):
    """Success if a stop counted within `radius_m`."""

    radius_m: float
    success: Rate


class Groups(Wire):
    """Success by what kind of task it was."""

    difficulty: dict[str, Rate]
    building: dict[str, Rate]
    footprint: dict[str, Rate]
    neighbours: dict[str, Rate]
    category: dict[str, Rate]
    floor: dict[str, Rate]
    sensors: dict[str, Rate] = {}
    light: dict[str, Rate] = {}
    weather: dict[str, Rate] = {}
    start: dict[str, Rate] = {}


class Absent(Wire):
    """The tasks whose object is not there. `not_found`: ended as object_not_found without a claim; `claimed`: claimed
    some window all the same; `windows_seen`: of the windows on the wanted floors; `inspected_share`: the mean of what
    the searches themselves say of the facade, null where none says it."""

    not_found: Rate
    claimed: Rate
    windows_seen: Rate
    inspected_share: float | None


class ExtensionFigure(Wire):
    """A figure of another package's metric. `rate` where it is a share of something; `value` is the share's rate or the
    number itself. Both are null where the run tells nothing, or where the metric failed: then `problem` says how."""

    title: str
    value: float | None
    rate: Rate | None = None
    problem: str | None = None


class Summary(Wire):
    """A run's figures. `infrastructure`: how many of the `tasks` flown say nothing, as a model or a service was out of
    reach; every rate is over the others, broken episodes included. `planned` is how many the run is to have.
    `render_s` and `model_s` are the parts of the episodes' wall time spent in the simulator's renderer and waiting for
    models; `wall_s` is the run's own, all workers together. `ideal_lap_spl`: the horizontal SPL of a lap with the map
    known and the facade unknown, on the same tasks. `asked`: in how many episodes the task's customer was
    asked something. `extensions`: figures of other packages' metrics."""

    tasks: int
    planned: int
    infrastructure: int = 0
    success: Rate
    floor_fail: Rate
    recognition_fail: Rate
    spl: Spl
    ideal_lap_spl: float | None = None
    average_steps: float | None
    collisions: int
    outcomes: dict[Reason, int]
    model_calls: dict[str, RoleCalls]
    wall_s: float
    render_s: float
    model_s: float
    floor_fail_half_floor: Rate
    success_curve: tuple[RadiusPoint, ...]
    groups: Groups
    errors: dict[str, int]
    absent: Absent | None = None
    asked: int = 0
    extensions: dict[Name, ExtensionFigure] = {}


def summarize(tasks: Mapping[str, Task], records: Sequence[EpisodeRecord], wall_s: float) -> Summary:
    """The figures of the episodes flown so far. `tasks` by id, all that the run is to fly; `wall_s` in seconds.

    Raises ValueError for a record of an unknown task, and for two records of one.
    """
    check_records(tasks, records)
    # by task, so that figures do not depend on which worker was first
    flown = sorted(records, key=lambda record: record.task)
    ordered = [record for record in flown if record.judged]
    reasons = Counter(record.reason for record in flown)
    # no way is the shortest to a thing that is not there
    there = [record for record in ordered if not tasks[record.task].absent]
    return Summary(
        tasks=len(flown),
        planned=len(tasks),
        infrastructure=len(flown) - len(ordered),
        success=_rate(success_rate(ordered)),
        floor_fail=_rate(floor_fail_rate(tasks, ordered)),
        recognition_fail=_rate(recognition_fail_rate(ordered)),
        spl=Spl(
            horizontal=_rounded(spl([horizontal(tasks[record.task], record) for record in there])),
            spatial=_rounded(spl([spatial(tasks[record.task], record) for record in there])),
        ),
        ideal_lap_spl=_rounded(ideal_lap_spl(tasks[record.task] for record in ordered)),
        average_steps=_rounded(average_steps(ordered)),
        collisions=collisions(ordered),
        outcomes={reason: reasons[reason] for reason in get_args(Reason) if reasons[reason]},
        model_calls=model_calls(flown),
        wall_s=round(wall_s, 3),
        render_s=round(sum(record.render_s for record in flown), 3),
        model_s=round(sum(record.model_s for record in flown), 3),
        floor_fail_half_floor=_rate(half_floor_fail_rate(tasks, ordered)),
        success_curve=tuple(
            RadiusPoint(radius_m=point.radius_m, success=_rate(point.success)) for point in success_curve(ordered)
        ),
        groups=_groups(tasks, ordered),
        errors=dict(sorted(Counter(record.error.splitlines()[0] for record in flown if record.error).items())),
        absent=_absent(absence(tasks, ordered)),
        asked=sum(record.questions > 0 for record in flown),
        extensions=_extensions(tasks, ordered),
    )


def _extensions(tasks: Mapping[str, Task], records: Sequence[EpisodeRecord]) -> dict[str, ExtensionFigure]:
    found = extension_figures(tasks, records, tuple(Summary.model_fields))
    return {name: _extension(figure) for name, figure in found.items()}


def _extension(figure: Figure) -> ExtensionFigure:
    if isinstance(figure.value, Proportion):
        rate = _rate(figure.value)
        return ExtensionFigure(title=figure.title, value=rate.rate, rate=rate)
    return ExtensionFigure(title=figure.title, value=figure.value, problem=figure.problem)


def horizontal(task: Task, record: EpisodeRecord) -> Flown:
    """The task's shortest way and the way flown, on the ground plan; a broken episode flew nowhere."""
    flown = record.result.path_horizontal_m if record.result is not None else 0.0
    return Flown(record.success, task.shortest_horizontal_m, flown)


def spatial(task: Task, record: EpisodeRecord) -> Flown:
    """The same in space."""
    flown = record.result.path_m if record.result is not None else 0.0
    return Flown(record.success, task.shortest_spatial_m, flown)


def _groups(tasks: Mapping[str, Task], records: Sequence[EpisodeRecord]) -> Groups:
    found = {name: breakdown(tasks, records, group.of, group.order) for name, group in GROUPINGS.items()}
    return Groups(**{name: {k: _rate(p) for k, p in groups.items()} for name, groups in found.items()})


def _absent(found: Absence | None) -> Absent | None:
    if found is None:
        return None
    return Absent(
        not_found=_rate(found.ended),
        claimed=_rate(found.claimed),
        windows_seen=_rate(found.windows),
        inspected_share=_rounded(found.said),
    )


def check_records(tasks: Mapping[str, Task], records: Sequence[EpisodeRecord]) -> None:
    """Raises ValueError for a record of an unknown task, and for two records of one."""
    twice = [name for name, times in Counter(record.task for record in records).items() if times > 1]
    if twice:
        raise ValueError(f"more than one record of task {twice[0]}")
    unknown = [record.task for record in records if record.task not in tasks]
    if unknown:
        raise ValueError(f"a record of task {unknown[0]}, which is not among the {len(tasks)} tasks of the run")


def _rate(proportion: Proportion) -> Rate:
    return Rate(**{name: _rounded(value) for name, value in proportion._asdict().items()})


def _rounded(value: float | None) -> float | None:
    """Six digits are more than any task set tells; whole numbers stay whole."""
    return value if value is None or isinstance(value, int) else round(value, 6)
