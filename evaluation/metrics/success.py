"""Success, and how it grows with the radius in which a stop counts; the steps it takes; claims of wrong windows."""

from collections.abc import Sequence
from typing import NamedTuple

from contracts.orchestrator import DeliveryResult
from contracts.sim import SUCCESS_RADIUS_M
from evaluation.metrics.episode import EpisodeRecord
from evaluation.metrics.proportion import Proportion, share

CURVE_RADII_M = (2.0, 3.0, 5.0, 7.0, 10.0)


class AtRadius(NamedTuple):
    """Success if a stop counted within `radius_m` of the window's centre."""

    radius_m: float
    success: Proportion


def success_rate(records: Sequence[EpisodeRecord]) -> Proportion:
    """Tasks delivered / all tasks; an episode that broke is a failure. Without records 0 of 0, no rate."""
    return share(record.success for record in records)


def stops_well(result: DeliveryResult | None, radius_m: float = SUCCESS_RADIUS_M) -> bool:
    """The right window claimed and stopped at as the judge wants it, but within `radius_m` of its centre."""
    verdict = result.verdict if result is not None else None
    return verdict is not None and bool(verdict.right_window) and verdict.stops_well(radius_m)


def success_curve(records: Sequence[EpisodeRecord], radii_m: Sequence[float] = CURVE_RADII_M) -> tuple[AtRadius, ...]:
    """One point a radius, over all tasks. Without records every point is 0 of 0."""
    return tuple(AtRadius(r, share(stops_well(record.result, r) for record in records)) for r in radii_m)


def average_steps(records: Sequence[EpisodeRecord]) -> float | None:
    """The mean over successful tasks only, as the paper has it; null without a success."""
    steps = [steps_of(record.result) for record in records if record.success and record.result is not None]
    return sum(steps) / len(steps) if steps else None


def steps_of(result: DeliveryResult) -> int:
    """Stops as the world counted them; as the mission did where no world counts: without a claim, on a vehicle of one's
    own, in results of version 0.2."""
    counted = result.verdict.steps if result.verdict is not None else None
    return result.steps if counted is None else counted


def recognition_fail_rate(records: Sequence[EpisodeRecord]) -> Proportion:
    """Wrong claims / tasks with a claim, as the paper has it. Without a claim 0 of 0, no rate."""
    claims = [record.result.verdict for record in records if record.result is not None and record.result.verdict]
    return share(verdict.right_window is False for verdict in claims)
