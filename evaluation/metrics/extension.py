"""Figures of other packages: one more line in a run's summary each.

An entry point (group `logisticsvln.metrics`) names a `Metric`. One that fails costs its own figure and nothing else: a
run that took hours is not lost to it.
"""

import logging
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import EntryPoint

from evaluation.metrics.episode import EpisodeRecord
from evaluation.metrics.proportion import Proportion
from evaluation.task_set.task import Task
from service_kit.extensions import METRICS, BadExtension, extensions, loaded

log = logging.getLogger("evaluation.metrics")

Value = Proportion | float | int | None


@dataclass(frozen=True)
class Metric:
    """`title` is shown beside the figure; `of` gets all tasks of the run by id and the episodes flown so far, and says
    None where they tell nothing."""

    title: str
    of: Callable[[Mapping[str, Task], Sequence[EpisodeRecord]], Value]


@dataclass(frozen=True)
class Figure:
    """A metric of one run. `problem`: why there is no value; None where the metric worked."""

    title: str
    value: Value
    problem: str | None = None


def extension_figures(
    tasks: Mapping[str, Task], records: Sequence[EpisodeRecord], reserved: Sequence[str] = ()
) -> dict[str, Figure]:
    """By the entry points' names. Where two packages bring one name, or one brings a `reserved` name, there is a single
    figure that says so."""
    try:
        points = extensions(METRICS, reserved=reserved)
    except BadExtension as error:
        log.warning("%s", error)
        return {"extensions": Figure("metrics of other packages", None, str(error))}
    return {name: _figure(point, tasks, records) for name, point in points.items()}


def _figure(point: EntryPoint, tasks: Mapping[str, Task], records: Sequence[EpisodeRecord]) -> Figure:
    title = name = point.name
    try:
        metric = loaded(point)
        if not isinstance(metric, Metric):
            raise BadExtension(f"{name} is no evaluation.metrics.extension.Metric but {type(metric).__name__}")
        title = metric.title
        return Figure(title, _checked(metric.of(tasks, records)))
    except Exception as error:  # a stranger's code
        log.warning("metric %s: %s: %s", name, type(error).__name__, error)
        return Figure(title, None, f"{type(error).__name__}: {error}")


def _checked(value: object) -> Value:
    if value is None or isinstance(value, Proportion):
        return value
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ValueError(f"a metric gives a finite number, a Proportion or None, not {value!r}")
    return value
