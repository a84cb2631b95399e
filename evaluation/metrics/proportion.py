"""k of n with its 95 % interval."""

import math
from collections.abc import Iterable
from typing import NamedTuple

Z_95 = 1.959963984540054


class Proportion(NamedTuple):
    """k of n; `rate`, `low` and `high` are null where n is 0."""

    k: int
    n: int
    rate: float | None
    low: float | None
    high: float | None

    def __str__(self) -> str:
        if self.rate is None or self.low is None or self.high is None:
            return f"{self.k}/{self.n} n/a"
        return f"{self.k}/{self.n} {100 * self.rate:.1f} % [{100 * self.low:.1f}, {100 * self.high:.1f}]"


def proportion(k: int, n: int, z: float = Z_95) -> Proportion:
    """The Wilson score interval (Wilson 1927, J. Am. Stat. Assoc. 22). Raises ValueError unless 0 <= k <= n."""
    if not 0 <= k <= n:
        raise ValueError(f"k must lie in 0..n, not {k} of {n}")
    if n == 0:
        return Proportion(0, 0, None, None, None)
    p = k / n
    middle = (p + z * z / (2 * n)) / (1 + z * z / n)
    half = z / (1 + z * z / n) * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    # at 0 and n the interval ends exactly there; the formula only nearly says so in floating point
    low = 0.0 if k == 0 else max(0.0, middle - half)
    high = 1.0 if k == n else min(1.0, middle + half)
    return Proportion(k, n, p, low, high)


def share(flags: Iterable[bool]) -> Proportion:
    """The proportion of true ones."""
    values = list(flags)
    return proportion(sum(values), len(values))
