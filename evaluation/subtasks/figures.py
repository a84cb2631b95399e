"""What a subtask's figures look like, whichever role was asked."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Literal, NamedTuple

from contracts.base import ModelName, Wire
from contracts.orchestrator import SightingSettings
from evaluation.metrics.model_calls import RoleCalls
from evaluation.metrics.proportion import share
from evaluation.metrics.summary import Rate

Subtask = Literal["floors", "recognition", "choice", "parse"]


class Figures(NamedTuple):
    """Rates and mean values by name, and rates by group; every one with its own denominator."""

    rates: dict[str, Rate]
    values: dict[str, float | None]
    groups: dict[str, dict[str, Rate]]


class SubtaskScores(Wire):
    """One role's figures. `questions` were answered over `tasks` tasks; one that brought no readable answer counts as
    wrong and shows in `model_calls` as well; one at which the model was out of reach shows there alone. `model`: who
    answered, by its own account. `skipped`: stops that the drone could not reach, or without a question. `sightings`:
    what counted as a claim, where things were looked for."""

    subtask: Subtask
    backend: ModelName
    model: str | None
    tasks: int
    questions: int
    skipped: int
    rates: dict[str, Rate]
    values: dict[str, float | None]
    groups: dict[str, dict[str, Rate]]
    sightings: SightingSettings | None = None
    model_calls: RoleCalls
    wall_s: float


def rate(flags: Iterable[bool]) -> Rate:
    """Of the true ones; 0 of 0 without any."""
    return Rate(**share(flags)._asdict())


def mean(values: Sequence[float]) -> float | None:
    """Null without values."""
    return round(sum(values) / len(values), 4) if values else None


def by_group(flags: Iterable[tuple[str, bool]], order: Sequence[str] = ()) -> dict[str, Rate]:
    """Rates of the groups that occur: those of `order` first, the rest by name."""
    found: dict[str, list[bool]] = {}
    for group, flag in flags:
        found.setdefault(group, []).append(flag)
    names = [name for name in order if name in found] + sorted(set(found) - set(order))
    return {name: rate(found[name]) for name in names}


def bin_of(value: float, bins: Mapping[str, float]) -> str:
    """The first bin whose upper end (left out) lies above the value; the last takes the rest."""
    return next((name for name, upper in bins.items() if value < upper), next(reversed(list(bins))))
