"""Growth told from noise: the slope of a process's memory over time, with its confidence, and a plot of it."""

import statistics
from collections.abc import Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import Literal, NamedTuple

WINDOWS = 8
T_95 = 2.447
"""Student's t for a two-sided 95 % with WINDOWS - 2 = 6 degrees of freedom."""
Verdict = Literal["flat", "grows", "undecided"]


class Memory(NamedTuple):
    """MB of a process: `own` is what it has written (anonymous pages, swapped ones too), `resident` its RSS, which has
    the mapped files as well; these the kernel takes back and gives again as it likes."""

    own: float
    resident: float


class Sample(NamedTuple):
    """The memory of each service, so many hours after the beginning and after so many deliveries."""

    hours: float
    deliveries: int
    services: Mapping[str, Memory]


class Slope(NamedTuple):
    """MB an hour of own memory, from `low` to `high` with 95 % confidence; the own memory in MB at the fit's ends."""

    mb_an_hour: float
    low: float
    high: float
    first_mb: float
    last_mb: float

    def verdict(self, bound: float) -> Verdict:
        """Whether it grows by that many MB an hour; undecided where the bound lies within the confidence."""
        if self.high < bound:
            return "flat"
        return "grows" if self.low >= bound else "undecided"


def memory_of(pid: int) -> Memory:
    """Raises ProcessLookupError where the process has ended, be it that nobody has asked yet how."""
    try:
        lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    except FileNotFoundError:
        raise ProcessLookupError(pid) from None
    kb = {name: int(value.split()[0]) for name, _, value in (line.partition(":") for line in lines) if "kB" in value}
    if "RssAnon" not in kb:
        raise ProcessLookupError(pid)
    return Memory((kb["RssAnon"] + kb["VmSwap"]) / 1024, kb["VmRSS"] / 1024)


def slope(samples: Sequence[Sample], service: str) -> Slope:
    """The line through the least of each of WINDOWS windows: what a request holds while it is answered, and what waits
    to be given back, is in all that is above the least.

    Raises ValueError where there are too few samples.
    """
    windows = _windows(samples)
    if len(windows) < WINDOWS:
        raise ValueError(f"{len(samples)} samples of {service} are too few for {WINDOWS} windows")
    hours = [statistics.fmean(sample.hours for sample in window) for window in windows]
    least = [min(sample.services[service].own for sample in window) for window in windows]
    line = statistics.linear_regression(hours, least)
    left = [mb - line.slope * at - line.intercept for at, mb in zip(hours, least, strict=True)]
    spread = sum((at - statistics.fmean(hours)) ** 2 for at in hours)
    error = (sum(mb * mb for mb in left) / (WINDOWS - 2) / spread) ** 0.5
    ends = (line.slope * at + line.intercept for at in (hours[0], hours[-1]))
    return Slope(line.slope, line.slope - T_95 * error, line.slope + T_95 * error, *ends)


def _windows(samples: Sequence[Sample]) -> list[list[Sample]]:
    first, whole = samples[0].hours, samples[-1].hours - samples[0].hours
    wide = max(whole, 1e-9) * 1.000_001 / WINDOWS
    return [list(window) for _, window in groupby(samples, key=lambda sample: int((sample.hours - first) / wide))]


def table(slopes: Mapping[str, Slope], samples: Sequence[Sample], bound: float) -> str:
    """A line for each service; `samples` are those that were fitted, `bound` in MB an hour."""
    lines = [f"{'service':<14}{'RSS MB':>8}{'own MB':>17}{'MB/h':>8}{'95 %':>18}{'KB/delivery':>13}  verdict"]
    deliveries = samples[-1].deliveries - samples[0].deliveries
    hours = samples[-1].hours - samples[0].hours
    for name, found in slopes.items():
        each = f"{found.mb_an_hour * hours * 1024 / deliveries:.1f}" if deliveries else "-"
        lines.append(
            f"{name:<14}{samples[-1].services[name].resident:>8.1f}"
            f"{f'{found.first_mb:.1f} to {found.last_mb:.1f}':>17}{found.mb_an_hour:>8.2f}"
            f"{f'{found.low:.2f} to {found.high:.2f}':>18}{each:>13}  {found.verdict(bound)}"
        )
    lines.append(f"over {deliveries} deliveries in {60 * hours:.0f} minutes, warm")
    return "\n".join(lines)


def plot(path: Path, samples: Sequence[Sample], warm: Sequence[Sample], slopes: Mapping[str, Slope]) -> None:
    """Own memory of each service over the minutes, and the fitted lines; PNG, SVG or PDF as the name ends."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    size = (9, 2.2 * len(slopes))
    figure, axes = pyplot.subplots(len(slopes), 1, sharex=True, squeeze=False, figsize=size, layout="constrained")
    minutes = [sample.hours * 60 for sample in samples]
    ends = [60 * warm[0].hours, 60 * warm[-1].hours]
    for axis, (name, found) in zip(axes[:, 0], slopes.items(), strict=True):
        axis.plot(minutes, [sample.services[name].own for sample in samples], linewidth=0.6)
        axis.plot(ends, [found.first_mb, found.last_mb], linewidth=1.5)
        axis.set_title(f"{name}: {found.mb_an_hour:+.2f} MB/h ({found.low:.2f} to {found.high:.2f})", fontsize=9)
        axis.set_ylabel("MB")
    axes[-1, 0].set_xlabel("minutes")
    with matplotlib.rc_context({"svg.fonttype": "none"}):
        figure.savefig(path)
    pyplot.close(figure)
