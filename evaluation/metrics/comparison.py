"""Two runs on the same tasks. Differences are always the run less its baseline: a positive one is the run's gain."""

from collections.abc import Mapping, Sequence

import numpy as np

from contracts.base import Wire
from evaluation.metrics.episode import EpisodeRecord
from evaluation.metrics.paired import Difference, mcnemar, paired_bootstrap
from evaluation.metrics.spl import spl
from evaluation.metrics.summary import check_records, horizontal, spatial
from evaluation.task_set.task import Task

BOOTSTRAP_SEED = 20_250
FEWEST_FOR_BOOTSTRAP = 10
"""Resampling a handful of tasks shows nothing but that handful: below this only the mean is given."""


class Change(Wire):
    """The run less its baseline, with the paired bootstrap's 95 % interval; all null without tasks in common, all but
    the mean for fewer than `FEWEST_FOR_BOOTSTRAP`."""

    mean: float | None
    low: float | None
    high: float | None


class Comparison(Wire):
    """A run and its baseline on the tasks that both flew. `only_*`: tasks that one of them alone solved. One test a
    figure: `success_p` is McNemar's, exact; those of both SPL the paired bootstrap's, null where the change has no
    interval."""

    tasks: int
    both: int
    only_run: int
    only_baseline: int
    neither: int
    success: Change
    success_p: float
    horizontal_spl: Change
    horizontal_spl_p: float | None
    spatial_spl: Change
    spatial_spl_p: float | None


def compare(tasks: Mapping[str, Task], run: Sequence[EpisodeRecord], baseline: Sequence[EpisodeRecord]) -> Comparison:
    """The paired tests over the tasks that say something in both. Raises ValueError for a record of a task that is not
    among `tasks`, and for two records of one."""
    check_records(tasks, run)
    check_records(tasks, baseline)
    a, b = ({record.task: record for record in records if record.judged} for records in (run, baseline))
    shared = sorted(a.keys() & b.keys())
    won = [[records[name].success for name in shared] for records in (a, b)]
    level, free = (
        [[spl([way(tasks[name], records[name])]) or 0.0 for name in shared] for records in (a, b)]
        for way in (horizontal, spatial)
    )
    test = mcnemar(won[0], won[1])
    rng = np.random.default_rng(BOOTSTRAP_SEED)
    both = sum(x and y for x, y in zip(*won, strict=True))
    success, plan, space = (paired_bootstrap(first, second, rng) for first, second in (won, level, free))
    enough = len(shared) >= FEWEST_FOR_BOOTSTRAP
    return Comparison(
        tasks=len(shared),
        both=both,
        only_run=test.only_first,
        only_baseline=test.only_second,
        neither=len(shared) - both - test.only_first - test.only_second,
        success=_change(success, enough),
        success_p=test.p,
        horizontal_spl=_change(plan, enough),
        horizontal_spl_p=plan.p if enough else None,
        spatial_spl=_change(space, enough),
        spatial_spl_p=space.p if enough else None,
    )


def _change(found: Difference, enough: bool) -> Change:
    return Change(mean=found.mean, low=found.low if enough else None, high=found.high if enough else None)
