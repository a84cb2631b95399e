"""Success weighted by path length (Anderson et al. 2018, arXiv:1807.06757)."""

import math
from collections.abc import Sequence
from typing import NamedTuple


class Flown(NamedTuple):
    """One task: whether it succeeded, the shortest collision-free way to success, the way flown; metres."""

    success: bool
    shortest_m: float
    flown_m: float


def spl(tasks: Sequence[Flown]) -> float | None:
    """The mean of S * L / max(P, L) over all tasks, 0..1; null without tasks.

    A shortest way of 0 (the drone starts where it may stop) counts as 1 when successful, whatever was flown: there is
    no length to be efficient about. Raises ValueError for a length that is negative or not finite.
    """
    if not tasks:
        return None
    for task in tasks:
        if (
            not (math.isfinite(task.shortest_m) and math.isfinite(task.flown_m))
            or min(task.shortest_m, task.flown_m) < 0
        ):
            raise ValueError(f"lengths must be finite and not negative: {task}")
    return sum(_weight(task) for task in tasks) / len(tasks)


def _weight(task: Flown) -> float:
    if not task.success:
        return 0.0
    return 1.0 if task.shortest_m == 0.0 else task.shortest_m / max(task.flown_m, task.shortest_m)
