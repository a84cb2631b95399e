"""Floor localization failures: did eq. 3 lead to the window's height?"""

from collections.abc import Mapping, Sequence

from contracts.orchestrator import DeliveryResult
from evaluation.metrics.episode import EpisodeRecord
from evaluation.metrics.proportion import Proportion, share
from evaluation.task_set.task import Task

TOLERANCE_M = 7.0
"""The paper's: a picture spans several floors, so the search forgives about two of them."""


def height_error_m(task: Task, result: DeliveryResult | None) -> float | None:
    """|h_final - h_tar| in metres; null where no height was found."""
    if result is None or result.final_height_m is None:
        return None
    return abs(result.final_height_m - task.target_height_m)


def floor_failed(task: Task, result: DeliveryResult | None, tolerance_m: float = TOLERANCE_M) -> bool:
    """More than `tolerance_m` off, or no height at all."""
    error_m = height_error_m(task, result)
    return error_m is None or error_m > tolerance_m


def floor_fail_rate(tasks: Mapping[str, Task], records: Sequence[EpisodeRecord]) -> Proportion:
    """Over all tasks flown, a missing height being a failure. Without records 0 of 0, no rate."""
    return share(floor_failed(tasks[record.task], record.result) for record in records)


def half_floor_fail_rate(tasks: Mapping[str, Task], records: Sequence[EpisodeRecord]) -> Proportion:
    """The same within half a floor of the window's centre, each building by its own floor height."""
    return share(
        floor_failed(tasks[record.task], record.result, tasks[record.task].floor_height_m / 2) for record in records
    )
