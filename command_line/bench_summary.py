"""A run's figures on a terminal."""

from rich.console import Console
from rich.table import Table

from evaluation.metrics.summary import ExtensionFigure, Rate, Summary


def print_summary(console: Console, summary: Summary, folder: str) -> None:
    """The main table, success by group, why episodes failed, and where everything lies."""
    main = Table(box=None, padding=(0, 2), show_header=False)
    main.add_row("tasks", f"{summary.tasks}" + (f" of {summary.planned}" if summary.tasks < summary.planned else ""))
    left_out = " (left out of every rate)" if summary.infrastructure else ""
    main.add_row("infrastructure failures", f"{summary.infrastructure}{left_out}")
    main.add_row("success rate", spoken(summary.success))
    spl = f"{_number(summary.spl.horizontal)} horizontal, {_number(summary.spl.spatial)} spatial"
    main.add_row("SPL", f"{spl}; an ideal lap {_number(summary.ideal_lap_spl)} horizontal")
    main.add_row("average steps", "n/a" if summary.average_steps is None else f"{summary.average_steps:.1f}")
    half = f"by half a floor {spoken(summary.floor_fail_half_floor)}"
    main.add_row("floor localization fails", f"by 7 m {spoken(summary.floor_fail)}; {half}")
    main.add_row("object recognition fails", spoken(summary.recognition_fail))
    main.add_row("collisions", f"{summary.collisions}")
    if (bare := summary.absent) is not None:
        main.add_row("object absent: not found", spoken(bare.not_found))
        main.add_row("object absent: claimed", spoken(bare.claimed))
        main.add_row("object absent: windows seen", spoken(bare.windows_seen))
    for figure in summary.extensions.values():
        main.add_row(figure.title, spoken_figure(figure))
    busy = summary.render_s + summary.model_s
    main.add_row(
        "time",
        f"{summary.wall_s:.0f} s, of which rendering {summary.render_s:.0f} s and models {summary.model_s:.0f} s"
        + (f" (wall/busy {summary.wall_s / busy:.2f})" if busy > 0 else ""),
    )
    console.print(main, highlight=False)
    for title, group in summary.groups.model_dump().items():
        table = Table(box=None, padding=(0, 2), title=f"success by {title}", title_justify="left", show_header=False)
        for name, rate in group.items():
            table.add_row(name.replace("_", " "), spoken(Rate(**rate)))
        console.print(table, highlight=False)
    reasons = "  ".join(f"{name} {count}" for name, count in summary.outcomes.items())
    console.print(f"outcomes  {reasons}", highlight=False)
    console.print(f"results in {folder}", highlight=False, soft_wrap=True)


def spoken_figure(figure: ExtensionFigure) -> str:
    """An extension's figure, or why there is none."""
    if figure.problem is not None:
        return f"failed: {figure.problem}"
    return spoken(figure.rate) if figure.rate is not None else _number(figure.value)


def spoken(rate: Rate) -> str:
    """`k/n p % [low, high]`."""
    if rate.rate is None or rate.low is None or rate.high is None:
        return f"{rate.k}/{rate.n} n/a"
    return f"{rate.k}/{rate.n}  {100 * rate.rate:.1f} %  [{100 * rate.low:.1f}, {100 * rate.high:.1f}]"


def _number(value: float | None) -> str:
    return "n/a" if value is None else f"{value:.3f}"
