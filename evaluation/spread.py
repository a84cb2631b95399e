"""A few of many, evenly over all, so that a small run meets every kind."""

from collections.abc import Sequence
from typing import TypeVar

T = TypeVar("T")


def spread(items: Sequence[T], limit: int | None) -> list[T]:
    """`limit` of them; all where there are no more, or no limit."""
    n = len(items) if limit is None else min(limit, len(items))
    return [items[k * len(items) // n] for k in range(n)]
