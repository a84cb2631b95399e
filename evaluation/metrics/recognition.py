"""Object recognition failures: how often the claimed window is not the customer's."""

from collections.abc import Sequence

from evaluation.metrics.episode import EpisodeRecord
from evaluation.metrics.proportion import Proportion, share


def recognition_fail_rate(records: Sequence[EpisodeRecord]) -> Proportion:
    """Wrong claims / tasks with a claim, as the paper has it. Without a claim 0 of 0, no rate."""
    claims = [record.result.verdict for record in records if record.result is not None and record.result.verdict]
    return share(verdict.right_window is False for verdict in claims)
