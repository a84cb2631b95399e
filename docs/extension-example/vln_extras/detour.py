"""A metric: how much farther than the shortest way the successful deliveries flew, on the ground plan."""

from collections.abc import Mapping, Sequence

from evaluation.metrics.episode import EpisodeRecord
from evaluation.metrics.extension import Metric
from evaluation.task_set.task import Task


def detour(tasks: Mapping[str, Task], records: Sequence[EpisodeRecord]) -> float | None:
    """The mean of flown / shortest over successes whose shortest way is not 0; None without one."""
    ratios = [
        record.result.path_horizontal_m / tasks[record.task].shortest_horizontal_m
        for record in records
        if record.success and record.result is not None and tasks[record.task].shortest_horizontal_m > 0
    ]
    return sum(ratios) / len(ratios) if ratios else None


METRIC = Metric("detour (flown / shortest)", detour)
