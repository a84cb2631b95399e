"""The whole page: runs, tables, charts, comparisons, failures; nothing is loaded from anywhere."""

from collections.abc import Callable, Sequence
from importlib.resources import files
from typing import get_args

from contracts.scene import BuildingKind
from evaluation.metrics.episode import Reason
from evaluation.metrics.summary import ExtensionFigure, Groups, Rate, Summary
from evaluation.report import charts
from evaluation.report.failures import REASONS, failures_of, gallery
from evaluation.report.markup import Html, interval, join, number, percent, tag
from evaluation.report.pictures import DEFAULT_BYTES
from evaluation.report.runs import Run
from evaluation.report.sections import compared, each_role_alone, models
from evaluation.report.tables import five_tables
from mission.wording import counted

TITLES = {kind: kind.replace("_", "-") for kind in get_args(BuildingKind)}
KINDS_OF_DIFFERENCE = (
    "The paper's figures come from the CARLA simulator, its own 300 tasks and 6 to 11 billion parameter models; ours "
    "from this project's simulator, its own tasks and the models named in each row. They are printed side by side to "
    "compare the layout and the effect of an ablation, not one number with the other. Small print: k/n, then the "
    "Wilson 95 % interval in percent; p: against the row with the paper's method on the tasks that both flew (success: "
    "McNemar, exact; horizontal SPL: paired bootstrap)."
)


def build_page(runs: Sequence[Run], limit_bytes: int = DEFAULT_BYTES) -> str:
    """One HTML document; its pictures take at most `limit_bytes`. Raises ValueError without a run."""
    if not runs:
        raise ValueError("a report needs at least one run")
    failures = failures_of(runs)
    body = join(
        (
            tag("header", tag("h1", "LogisticsVLN evaluation"), tag("p", _told(runs), class_="soft"), _nav(runs)),
            tag("section", *(_run_card(k, run) for k, run in enumerate(runs)), class_="runs", id="runs"),
            tag("h2", "The paper's tables, and ours", id="tables"),
            tag("p", KINDS_OF_DIFFERENCE, class_="note"),
            five_tables(runs),
            tag("h2", "Figures", id="figures"),
            _legend(runs),
            _figures(runs),
            tag("h2", "Models", id="models"),
            models(runs),
            *each_role_alone(runs),
            *compared(runs),
            tag("h2", "Failures", tag("small", f" {len(failures)}"), id="failures"),
            gallery(runs, failures, limit_bytes),
        )
    )
    here = files("evaluation.report")
    style, script = ((here / name).read_text(encoding="utf-8") for name in ("page.css", "page.js"))
    head = join(
        (
            tag("meta", charset="utf-8"),
            tag("meta", name_="viewport", content="width=device-width, initial-scale=1"),
            tag("meta", name_="color-scheme", content="light dark"),
            tag("link", rel="icon", href="data:,"),
            tag("title", f"LogisticsVLN: {', '.join(run.label for run in runs)}"),
            tag("style", Html(style)),
        )
    )
    foot = join((tag("dialog", id="large"), tag("script", Html(script))))
    return f'<!doctype html>\n<html lang="en"><head>{head}</head><body><main>{body}</main>{foot}</body></html>\n'


def _told(runs: Sequence[Run]) -> str:
    sets = dict.fromkeys(run.settings.tasks for run in runs)
    return f"{counted(len(runs), 'run')} over {', '.join(sets)}"


def _nav(runs: Sequence[Run]) -> Html:
    alone = ["alone"] if any(run.alone for run in runs) else []
    pairs = ["compared"] if len(runs) > 1 else []
    names = ["tables", "figures", "models", *alone, *pairs, "failures"]
    return tag("nav", *(tag("a", name, href=f"#{name}") for name in names))


def _share_of(summary: Summary) -> str:
    """The run's SPL as a share of the ideal lap's."""
    if not summary.ideal_lap_spl or summary.spl.horizontal is None:
        return ""
    return f"; reached {summary.spl.horizontal / summary.ideal_lap_spl:.2f} of it"


def _run_card(k: int, run: Run) -> Html:
    summary, settings = run.summary, run.settings
    busy = summary.render_s + summary.model_s
    part = f" of {summary.planned}" if summary.planned != summary.tasks else ""
    facts = [
        ("SPL", f"{percent(summary.spl.horizontal)} % horizontal, {percent(summary.spl.spatial)} % spatial"),
        ("Ideal lap's horizontal SPL", f"{percent(summary.ideal_lap_spl)} %" + _share_of(summary)),
        ("Average steps", number(summary.average_steps)),
        ("Infrastructure failures", f"{summary.infrastructure} of {summary.tasks} tasks, in no rate"),
        ("Floor failures, 7 m", _of(summary.floor_fail, "n/a")),
        ("Floor failures, half a floor", _of(summary.floor_fail_half_floor, "n/a")),
        ("Recognition failures", _of(summary.recognition_fail)),
        ("Collisions", str(summary.collisions)),
        *((figure.title, _figure(figure)) for figure in summary.extensions.values()),
        ("Time", f"{_duration(summary.wall_s)} with {counted(settings.workers, 'worker')}"),
        ("Rendering and models", _duration(busy) + (f"; wall time {summary.wall_s / busy:.2f} of it" if busy else "")),
    ]
    return tag(
        "article",
        tag("h3", tag("i", class_=f"key r{k}"), run.label),
        tag(
            "p",
            tag("b", percent(summary.success.rate), class_="big"),
            " % success ",
            tag("small", interval(summary.success)),
            class_="headline",
        ),
        tag("p", f"{counted(summary.tasks, 'task')}{part} of {settings.tasks}", class_="soft"),
        tag("dl", *(join((tag("dt", name), tag("dd", value))) for name, value in facts)),
        tag(
            "details",
            tag("summary", "Settings"),
            tag("pre", settings.model_dump_json(indent=1)),
        ),
        class_="card",
    )


def _figure(figure: ExtensionFigure) -> str:
    if figure.problem is not None:
        return f"failed: {figure.problem}"
    return _of(figure.rate, "n/a") if figure.rate is not None else number(figure.value, 3)


def _of(rate: Rate, without: str = "no claim") -> str:
    return without if rate.rate is None else f"{percent(rate.rate)} % ({rate.k}/{rate.n})"


def _duration(seconds: float) -> str:
    if seconds < 120:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s" if minutes < 120 else f"{minutes // 60} h {minutes % 60} min"


def _legend(runs: Sequence[Run]) -> Html:
    if len(runs) == 1:
        return Html("")
    return tag(
        "p", *(tag("span", tag("i", class_=f"key r{k}"), run.label) for k, run in enumerate(runs)), class_="legend"
    )


def _figures(runs: Sequence[Run]) -> Html:
    curve = charts.curve(
        [
            charts.Series(k, run.label, [(p.radius_m, p.success) for p in run.summary.success_curve])
            for k, run in enumerate(runs)
        ],
        "stop within so many metres of the window's centre",
    )
    outcomes = {
        reason: [(k, run.label, run.summary.outcomes.get(reason, 0), run.summary.tasks) for k, run in enumerate(runs)]
        for reason in get_args(Reason)
        if any(run.summary.outcomes.get(reason) for run in runs)
    }
    parts: list[tuple[str, Callable[[Groups], dict[str, Rate]]]] = [
        ("Success by difficulty (%)", lambda groups: groups.difficulty),
        ("Success by building (%)", lambda groups: groups.building),
        ("Success by footprint (%)", lambda groups: groups.footprint),
        ("Success by neighbours (%)", lambda groups: groups.neighbours),
        ("Success by floor asked for (%)", lambda groups: groups.floor),
        ("Success by category of object (%)", lambda groups: groups.category),
    ]
    cards = [
        _chart("How each task ended", charts.bars(outcomes, REASONS)),
        _chart("Success by radius (%)", curve),
        *(_chart(title, charts.whiskers(_grouped(runs, pick), TITLES)) for title, pick in parts),
    ]
    return tag("div", *cards, class_="charts")


def _grouped(runs: Sequence[Run], pick: Callable[[Groups], dict[str, Rate]]) -> dict[str, list[tuple[int, str, Rate]]]:
    names = dict.fromkeys(name for run in runs for name in pick(run.summary.groups))
    return {
        name: [(k, run.label, rates[name]) for k, run in enumerate(runs) if name in (rates := pick(run.summary.groups))]
        for name in names
    }


def _chart(title: str, chart: Html) -> Html:
    return tag("section", tag("h3", title), chart, class_="card")
