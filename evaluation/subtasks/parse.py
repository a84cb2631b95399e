"""Parsing alone: are floor and object exactly those of the request?"""

from collections.abc import Sequence
from typing import NamedTuple

from evaluation.metrics.taxonomy import plain
from evaluation.subtasks.figures import Figures, by_group, rate


class Parsed(NamedTuple):
    """One request: what it says, and what was found in it (null: missing, or no readable answer)."""

    style: str
    floor: int
    object: str
    found_floor: int | None
    found_object: str | None


def score(requests: Sequence[Parsed]) -> Figures:
    """Exact floor, exact object (case, blanks and hyphens don't count), and both, over all requests."""
    return Figures(
        rates={
            "floor": rate(floor_right(request) for request in requests),
            "object": rate(object_right(request) for request in requests),
            "both": rate(floor_right(request) and object_right(request) for request in requests),
        },
        values={},
        groups={
            "both by style": by_group(
                (request.style, floor_right(request) and object_right(request)) for request in requests
            )
        },
    )


def floor_right(request: Parsed) -> bool:
    return request.found_floor == request.floor


def object_right(request: Parsed) -> bool:
    return request.found_object is not None and plain(request.found_object) == plain(request.object)
