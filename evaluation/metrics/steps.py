"""Average Steps: stops with a model query on the way to a success."""

from collections.abc import Sequence

from evaluation.metrics.episode import EpisodeRecord


def average_steps(records: Sequence[EpisodeRecord]) -> float | None:
    """The mean over successful tasks only, as the paper has it; null without a success."""
    steps = [record.result.steps for record in records if record.success and record.result is not None]
    return sum(steps) / len(steps) if steps else None
