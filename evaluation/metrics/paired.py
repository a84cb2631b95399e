"""Tests between two arms that flew the same tasks."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np


class McNemar(NamedTuple):
    """`only_first` and `only_second`: tasks that just one arm solved; `p`: exact, two-sided."""

    only_first: int
    only_second: int
    p: float


class Difference(NamedTuple):
    """first - second, with the paired bootstrap's 95 % interval and two-sided p; all null without tasks."""

    mean: float | None
    low: float | None
    high: float | None
    p: float | None


def mcnemar(first: Sequence[bool], second: Sequence[bool]) -> McNemar:
    """McNemar's exact test: under the null hypothesis a task solved by one arm only is a fair coin's. p is 1 where no
    task tells the arms apart. Raises ValueError for arms of different length."""
    if len(first) != len(second):
        raise ValueError(f"paired arms need the same tasks: {len(first)} and {len(second)}")
    b = sum(x and not y for x, y in zip(first, second, strict=True))
    c = sum(y and not x for x, y in zip(first, second, strict=True))
    n, k = b + c, min(b, c)
    tail = sum(math.comb(n, i) for i in range(k + 1)) / 2**n
    return McNemar(b, c, min(1.0, 2 * tail))


def paired_bootstrap(
    first: Sequence[float], second: Sequence[float], rng: np.random.Generator, resamples: int = 10_000
) -> Difference:
    """The difference of means, tasks resampled with replacement. Raises ValueError for arms of different length."""
    if len(first) != len(second):
        raise ValueError(f"paired arms need the same tasks: {len(first)} and {len(second)}")
    if not first:
        return Difference(None, None, None, None)
    differences = np.asarray(first, dtype=np.float64) - np.asarray(second, dtype=np.float64)
    n = len(differences)
    means = differences[rng.integers(0, n, size=(resamples, n))].mean(axis=1)
    low, high = np.percentile(means, [2.5, 97.5])
    # one is added to both counts: a bootstrap never proves a probability of zero
    tail = min(int((means <= 0).sum()), int((means >= 0).sum()))
    p = min(1.0, 2 * (tail + 1) / (resamples + 1))
    return Difference(float(differences.mean()), float(low), float(high), p)
