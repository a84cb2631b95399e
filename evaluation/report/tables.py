"""The paper's five tables, each with ours beside it in the same layout."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

from evaluation.metrics.comparison import Comparison
from evaluation.metrics.summary import Rate
from evaluation.report import paper
from evaluation.report.comparison import against
from evaluation.report.markup import Html, interval, join, number, p_value, percent, tag, text
from evaluation.report.runs import Run
from mission.policies import label_of
from mission.policies.points import POINTS_POLICIES, PaperPolicy
from mission.wording import counted

SCORE_HEADS = ("SR (%) ↑", "SPL (%) ↑", "Average Steps ↓")
INFRASTRUCTURE = "Infrastructure failures"
"""A column of ours alone: the tasks at which a model or a service was out of reach, which are in no rate."""


class Row(NamedTuple):
    """One row of ours: what it is, the run that fills it (null: not flown), the run to test it against."""

    name: str
    run: Run | None
    baseline: Run | None = None
    hint: str = ""


def five_tables(runs: Sequence[Run]) -> Html:
    """All five, in the paper's order."""
    return join(
        (
            _pair(
                "Table 1. Models",
                "the whole task set with the paper's policy",
                _scored("VLM", paper.MODELS),
                _our_scores("Model", [Row(run.model, run) for run in _plain(runs)]),
            ),
            _pair(
                "Table 2. Floor localization",
                "final height more than 7 m off the window's, or none found; the paper's method is the stepwise one",
                _paper_floors(),
                _our_floors(runs),
            ),
            _pair(
                "Table 3. Object recognition",
                "wrong claims over tasks with a claim",
                _paper_recognition(),
                _our_recognition(_plain(runs)),
            ),
            _pair(
                "Table 4. Viewpoint selection",
                "eq. 4–6 against a random view and against always the right-hand one",
                _scored("VS strategy", paper.VIEWPOINT),
                _our_scores(
                    "VS strategy",
                    _ablation(runs, _searches(runs), lambda run: run.arm.viewpoint.policy or "", "viewpoint"),
                ),
            ),
            _pair(
                "Table 5. Choice VLM",
                "the model's choice among the five points against always the centre",
                _scored("Choice VLM", paper.CHOICE),
                _our_scores(
                    "Choice VLM",
                    _ablation(runs, (Arm("✓", "model"), Arm("✗", "centre")), _choice, "choice"),
                ),
            ),
        )
    )


class Arm(NamedTuple):
    """A row of an ablation: its name, the setting's value, and whether the paper has it too."""

    name: str
    value: str
    of_paper: bool = True


def _searches(runs: Sequence[Run]) -> list[Arm]:
    """The paper's three ways to pick a view, and every other search policy that was flown."""
    flown = dict.fromkeys(run.arm.viewpoint.policy or "" for run in runs)
    others = [name for name in flown if name not in POINTS_POLICIES]
    papers = [Arm(label_of(name).capitalize(), name) for name in POINTS_POLICIES]
    return papers + [Arm(label_of(name).capitalize(), name, of_paper=False) for name in others]


def _choice(run: Run) -> str:
    """Who chose among the points; a policy without points has nothing to choose."""
    return str(run.arm.viewpoint.constants.get("choice", "model"))


def _plain(runs: Sequence[Run]) -> list[Run]:
    """The runs with the paper's method."""
    return [run for run in runs if _is_plain(run)]


def _is_plain(run: Run) -> bool:
    return not _changed(run)


def _others_plain(run: Run, option: str) -> bool:
    return not _changed(run) - {option}


def _changed(run: Run) -> set[str]:
    """The ablations that a run flies, by the command line's names."""
    arm = run.arm
    usual = {
        "viewpoint": arm.viewpoint.policy == PaperPolicy.name,
        "choice": _choice(run) == "model",
        "floors": arm.floors == "stepwise",
    }
    return {option for option, as_usual in usual.items() if not as_usual}


def _ablation(runs: Sequence[Run], arms: Sequence[Arm], setting: Callable[[Run], str], option: str) -> list[Row]:
    """For each model one row an arm, tested against the paper's method on the tasks that both flew."""
    rows = []
    models = list(dict.fromkeys(run.model for run in runs))
    for model in models:
        own = [run for run in runs if run.model == model]
        baseline = next(iter(_plain(own)), None)
        for name, value, of_paper in arms:
            # only this one setting may differ from the paper's method
            fitting = [run for run in own if setting(run) == value and _others_plain(run, option)]
            shown = f"{name} · {model}" if len(models) > 1 else name
            hint = f"logisticsvln bench --backend {own[0].settings.backend} --{option} {value}"
            # what is no arm of the paper's shows where it was flown
            if not fitting and of_paper:
                rows.append(Row(shown, None, None, hint))
            rows += [Row(shown, run, baseline if run is not baseline else None, hint) for run in fitting]
    return rows


def _pair(title: str, what: str, theirs: Html, ours: Html) -> Html:
    return tag(
        "section",
        tag("h3", title, " ", tag("small", what)),
        tag(
            "div",
            tag("figure", tag("figcaption", "The paper"), theirs, class_="scroll"),
            tag("figure", tag("figcaption", "Ours"), ours, class_="scroll"),
            class_="pair",
        ),
        class_="card",
    )


def _scored(first: str, rows: Sequence[paper.Scored]) -> Html:
    return _table(
        (first, *SCORE_HEADS),
        [[text(r.name), _n(r.success_pct, 1), _n(r.spl_pct, 1), _n(r.steps, 2)] for r in rows],
    )


def _our_scores(first: str, rows: Sequence[Row]) -> Html:
    if not rows:
        return _none("no run with the paper's policy is part of this report")
    cells = []
    for row in rows:
        if row.run is None:
            cells.append([text(row.name), _not_flown(row.hint)])
            continue
        test = _test(row)
        summary = row.run.summary
        beside = f"horizontal · spatial {percent(summary.spl.spatial)} · ideal lap {percent(summary.ideal_lap_spl)}"
        spl = _number(
            percent(summary.spl.horizontal), beside + (f" · p {p_value(test.horizontal_spl_p)}" if test else "")
        )
        cells.append(
            [
                text(row.name),
                _rate(summary.success, f"p {p_value(test.success_p)}" if test is not None else ""),
                spl,
                _number(number(summary.average_steps), counted(summary.success.k, "success", "successes")),
                _infrastructure(row.run),
            ]
        )
    return _table((first, *SCORE_HEADS, INFRASTRUCTURE), cells)


def _infrastructure(run: Run) -> Html:
    return _number(str(run.summary.infrastructure), f"of {counted(run.summary.tasks, 'task')}")


def _test(row: Row) -> Comparison | None:
    if row.run is None or row.baseline is None:
        return None
    found = against(row.run, row.baseline)
    return found if found.tasks else None


def _paper_floors() -> Html:
    return _table(
        ("ID", "VLM", "FL method", "FL fail rate (%) ↓"),
        [[text(r.id), text(r.model), text(r.method), _n(r.fail_pct, 1)] for r in paper.FLOORS],
    )


def _our_floors(runs: Sequence[Run]) -> Html:
    fitting = [run for run in runs if _others_plain(run, "floors")]
    if not fitting:
        return _none("no run with the paper's viewpoint and choice is part of this report")
    methods = {"stepwise": "Stepwise", "direct-count": "Direct Count"}
    cells = [
        [
            text("abcdefghijklmnopqrstuvwxyz"[at % 26]),
            text(run.model),
            text(methods[run.arm.floors]),
            _rate(run.summary.floor_fail, f"7 m · ½ floor: {percent(run.summary.floor_fail_half_floor.rate)}"),
            _infrastructure(run),
        ]
        for at, run in enumerate(fitting)
    ]
    return _table(("ID", "Model", "FL method", "FL fail rate (%) ↓", INFRASTRUCTURE), cells)


def _paper_recognition() -> Html:
    return _table(("VLM", "OR fail rate (%) ↓"), [[text(r.model), _n(r.fail_pct, 1)] for r in paper.RECOGNITION])


def _our_recognition(runs: Sequence[Run]) -> Html:
    if not runs:
        return _none("no run with the paper's policy is part of this report")
    return _table(
        ("Model", "OR fail rate (%) ↓", INFRASTRUCTURE),
        [[text(run.model), _rate(run.summary.recognition_fail), _infrastructure(run)] for run in runs],
    )


def _table(heads: Sequence[str], rows: Sequence[Sequence[Html]]) -> Html:
    body = []
    for row in rows:
        missing = len(heads) - len(row)
        cells = [
            tag("td", cell, colspan=1 + missing if at == len(row) - 1 and missing else None)
            for at, cell in enumerate(row)
        ]
        body.append(tag("tr", *cells))
    return tag(
        "table",
        tag("thead", tag("tr", *(tag("th", head) for head in heads))),
        tag("tbody", *body),
        class_="booktabs",
    )


def _n(value: float, digits: int) -> Html:
    return _number(f"{value:.{digits}f}")


def _rate(rate: Rate, more: str = "") -> Html:
    return _number(percent(rate.rate), " · ".join(part for part in (interval(rate), more) if part))


def _number(main: str, small: str = "") -> Html:
    return join((tag("b", main), tag("small", small) if small else ""))


def _not_flown(hint: str) -> Html:
    return tag("span", "not flown: ", tag("code", hint), class_="soft")


def _none(why: str) -> Html:
    return tag("p", why, class_="soft")
