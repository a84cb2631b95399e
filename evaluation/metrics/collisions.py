"""Collisions: tasks on which the drone touched anything, however they ended."""

from collections.abc import Sequence

from contracts.orchestrator import DeliveryResult
from evaluation.metrics.episode import EpisodeRecord


def collided(result: DeliveryResult | None) -> bool:
    """On the way or at the claim; false where no result tells."""
    if result is None:
        return False
    return result.outcome == "collision" or (result.verdict is not None and result.verdict.collided)


def collisions(records: Sequence[EpisodeRecord]) -> int:
    """The number of tasks with a collision; 0 without records."""
    return sum(collided(record.result) for record in records)
