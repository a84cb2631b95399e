"""A run's progress: a live table on a terminal, a line now and then elsewhere."""

import time
from collections import Counter

from rich.console import Console
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table

from command_line.console import Printed, Redrawn
from evaluation.bench.run import Standing
from evaluation.metrics.proportion import proportion
from mission.wording import counted

LINE_EVERY_S = 15.0


class LiveProgress(Redrawn):
    """A table that is redrawn in place."""

    def __init__(self, console: Console, title: str) -> None:
        self._title = title
        self._last: list[str] = []
        self._reasons: Counter[str] = Counter()
        self._live = Live(console=console, refresh_per_second=4, transient=True)
        super().__init__(self._live)

    def show(self, now: Standing) -> None:
        if now.last is not None:
            self._reasons[now.last.reason] += 1
            self._last = [*self._last, f"{now.last.task}  {now.last.reason}  {now.last.wall_s:.1f} s"][-4:]
        grid = Table.grid(padding=(0, 2))
        grid.add_column(style="dim", justify="right")
        grid.add_column()
        grid.add_row("run", self._title)
        grid.add_row("done", f"{now.done} of {now.total}")
        grid.add_row("", ProgressBar(total=max(1, now.total), completed=now.done, width=40))
        grid.add_row("rate", _rate(now))
        grid.add_row("time left", _left(now))
        grid.add_row("success", _success(now))
        if self._reasons:
            grid.add_row("outcomes", "  ".join(f"{name} {n}" for name, n in self._reasons.most_common()))
        for line in self._last:
            grid.add_row("", line, style="dim")
        self._live.update(grid)


class PlainProgress(Printed):
    """One line at most every `LINE_EVERY_S`, and one at the end."""

    def __init__(self, console: Console, title: str) -> None:
        self._console = console
        self._title = title
        self._said = -LINE_EVERY_S

    def show(self, now: Standing) -> None:
        if time.monotonic() - self._said < LINE_EVERY_S and now.done < now.total:
            return
        self._said = time.monotonic()
        self._console.print(
            f"{self._title}: {now.done}/{now.total} done, {_rate(now)}, {_left(now)} left, success {_success(now)}",
            highlight=False,
            soft_wrap=True,
        )


def _success(now: Standing) -> str:
    left_out = f", {now.infrastructure} infrastructure" if now.infrastructure else ""
    return f"{proportion(now.successes, now.done - now.infrastructure)}{left_out}"


def _rate(now: Standing) -> str:
    if not now.flown or now.session_s <= 0:
        return "n/a"
    return f"{60 * now.flown / now.session_s:.1f} episodes a minute by {counted(now.workers, 'worker')}"


def _left(now: Standing) -> str:
    if not now.flown:
        return "n/a"
    seconds = round((now.total - now.done) * now.session_s / now.flown)
    minutes, seconds = divmod(seconds, 60)
    return f"{minutes // 60}:{minutes % 60:02d}:{seconds:02d}" if minutes >= 60 else f"{minutes}:{seconds:02d}"
