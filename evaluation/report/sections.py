"""Three of the page's sections: what the models were asked, each role alone, the runs compared."""

from collections.abc import Sequence
from itertools import combinations

from evaluation.report import charts
from evaluation.report.comparison import against, change
from evaluation.report.markup import Html, join, number, p_value, tag
from evaluation.report.runs import Run
from mission.wording import counted

ROLE_TITLES = {
    "recall_first": "first is right",
    "false_claim": "false claims",
    "within_one": "within one",
    "centre_agrees": "centre agrees",
}


def models(runs: Sequence[Run]) -> Html:
    """What each run asked of each role, and how long it waited."""
    heads = (
        "Run",
        "Role",
        "Calls",
        "From cache",
        "Unreadable",
        "Refused",
        "Unreachable",
        "Tokens in",
        "Tokens out",
        "p50 (s)",
        "p95 (s)",
        "p99 (s)",
    )
    rows = []
    for k, run in enumerate(runs):
        for role, calls in run.summary.model_calls.items():
            waits = calls.latency_s
            figures = (
                calls.calls,
                calls.cache_hits,
                calls.unreadable,
                calls.refused,
                calls.unreachable,
                calls.prompt_tokens,
                calls.completion_tokens,
                number(waits.p50, 3),
                number(waits.p95, 3),
                number(waits.p99, 3),
            )
            rows.append(
                tag(
                    "tr",
                    tag("td", tag("i", class_=f"key r{k}"), run.label),
                    tag("td", role),
                    *(tag("td", figure) for figure in figures),
                )
            )
    if not rows:
        return tag("p", "No model was asked.", class_="soft")
    table = tag(
        "table",
        tag("thead", tag("tr", *(tag("th", head) for head in heads))),
        tag("tbody", *rows),
        class_="booktabs figures",
    )
    return tag(
        "section",
        tag("div", table, class_="scroll"),
        tag("p", "Percentiles are of the calls that no cache answered.", class_="soft"),
        class_="card",
    )


def each_role_alone(runs: Sequence[Run]) -> list[Html]:
    """The figures of single roles, where a run's folder has them."""
    cards = [
        tag(
            "section",
            tag("h3", tag("i", class_=f"key r{k}"), scores.subtask, " ", tag("small", scores.model or scores.backend)),
            tag("p", f"{counted(scores.questions, 'question')} over {counted(scores.tasks, 'task')}", class_="soft"),
            charts.whiskers({name: [(k, run.label, rate)] for name, rate in scores.rates.items()}, ROLE_TITLES),
            *(
                join(
                    (
                        tag("p", title, class_="soft"),
                        charts.whiskers({n: [(k, run.label, r)] for n, r in g.items()}, {}),
                    )
                )
                for title, g in scores.groups.items()
                if g
            ),
            tag(
                "dl", *(join((tag("dt", n.replace("_", " ")), tag("dd", number(v)))) for n, v in scores.values.items())
            ),
            class_="card",
        )
        for k, run in enumerate(runs)
        for scores in run.alone
    ]
    return [tag("h2", "Each role alone", id="alone"), tag("div", *cards, class_="charts")] if cards else []


def compared(runs: Sequence[Run]) -> list[Html]:
    """Every pair of runs on the tasks that both flew."""
    if len(runs) < 2:
        return []
    heads = (
        "Run",
        "Against",
        "Tasks",
        "Both",
        "Only the run",
        "Only the other",
        "Neither",
        "Success gained",
        "p",
        "Horizontal SPL gained",
        "p",
        "Spatial SPL gained",
        "p",
    )
    rows = []
    for (j, baseline), (k, run) in combinations(enumerate(runs), 2):
        found = against(run, baseline)
        rows.append(
            tag(
                "tr",
                tag("td", tag("i", class_=f"key r{k}"), run.label),
                tag("td", tag("i", class_=f"key r{j}"), baseline.label),
                *(tag("td", n) for n in (found.tasks, found.both, found.only_run, found.only_baseline, found.neither)),
                tag("td", change(found.success)),
                tag("td", p_value(found.success_p) if found.tasks else "n/a"),
                tag("td", change(found.horizontal_spl)),
                tag("td", p_value(found.horizontal_spl_p)),
                tag("td", change(found.spatial_spl)),
                tag("td", p_value(found.spatial_spl_p)),
            )
        )
    table = tag(
        "table",
        tag("thead", tag("tr", *(tag("th", head) for head in heads))),
        tag("tbody", *rows),
        class_="booktabs figures pairs",
    )
    told = (
        "What the run gains over the one it is held against, in percentage points with the paired bootstrap's 95 % "
        "interval (10,000 resamples, from ten tasks on); the signs are those of `logisticsvln compare`. The p of "
        "success is McNemar's, exact, over the tasks that one of the two alone solved; that of SPL is the bootstrap's. "
        "Tasks are the same where all but their names is. No correction for several comparisons."
    )
    return [
        tag("h2", "Runs compared", id="compared"),
        tag("section", tag("div", table, class_="scroll"), tag("p", told, class_="soft"), class_="card"),
    ]
