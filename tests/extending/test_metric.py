"""A metric from a package outside the tree, in the commands' own processes."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from command_line.bench_summary import spoken_figure
from evaluation.metrics.proportion import proportion
from evaluation.metrics.summary import ExtensionFigure, Rate
from tests.evaluation.evaluation_kit import a_record, a_result, a_run, a_task, delivered
from tests.extending.conftest import install

TASKS = [a_task("t-1", shortest_horizontal_m=10.0), a_task("t-2", shortest_horizontal_m=20.0), a_task("t-3")]


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """Two successes, 25 m and 30 m flown, and a failure."""
    records = [
        a_record(TASKS[0], delivered(path_horizontal_m=25.0)),
        a_record(TASKS[1], delivered(path_horizontal_m=30.0)),
        a_record(TASKS[2], a_result("object_not_found")),
    ]
    return a_run(tmp_path / "run", TASKS, records)


def command(site: Path, *arguments: str | Path) -> str:
    done = subprocess.run(
        [sys.executable, "-m", "command_line", *map(str, arguments)],
        env=os.environ | {"PYTHONPATH": str(site)},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_an_installed_metric_is_a_figure_of_every_run_and_a_line_of_the_report(extras: Path, run: Path) -> None:
    arms = json.loads(command(extras, "compare", run, run, "--json"))["arms"]
    figure = arms[0]["summary"]["extensions"]["detour"]
    assert figure == {"title": "detour (flown / shortest)", "value": 2.0, "rate": None, "problem": None}
    command(extras, "report", run)
    page = (run / "report.html").read_text(encoding="utf-8")
    assert "<dt>detour (flown / shortest)</dt><dd>2.000</dd>" in page


BROKEN = """
from evaluation.metrics.extension import Metric
from evaluation.metrics.proportion import share

def fails(tasks, records):
    raise KeyError("no such task")

FAILS = Metric("always fails", fails)
INFINITE = Metric("not finite", lambda tasks, records: float("inf"))
SHARE = Metric("won", lambda tasks, records: share(record.success for record in records))
NO_METRIC = 3
"""


def test_a_metric_that_fails_costs_its_own_figure_only(tmp_path: Path, run: Path) -> None:
    package = tmp_path / "source"
    (package / "odd_metrics").mkdir(parents=True)
    (package / "odd_metrics" / "__init__.py").write_text(BROKEN)
    names = ("FAILS", "INFINITE", "SHARE", "NO_METRIC", "MISSING")
    points = "".join(f'{name.lower()} = "odd_metrics:{name}"\n' for name in names)
    (package / "pyproject.toml").write_text(
        f'[project]\nname = "odd-metrics"\nversion = "1"\n[project.entry-points."logisticsvln.metrics"]\n{points}'
    )
    site = install(package, tmp_path / "site")
    summary = json.loads(command(site, "compare", run, run, "--json"))["arms"][0]["summary"]
    assert (summary["success"]["k"], summary["success"]["n"]) == (2, 3)
    figures = summary["extensions"]
    assert (figures["share"]["rate"]["k"], figures["share"]["rate"]["n"], figures["share"]["problem"]) == (2, 3, None)
    problems = {name: figure["problem"] for name, figure in figures.items() if figure["problem"]}
    assert set(problems) == {"fails", "infinite", "no_metric", "missing"}
    assert "no such task" in problems["fails"]
    assert "finite" in problems["infinite"]
    assert "int" in problems["no_metric"]
    assert "odd-metrics" in problems["missing"]


def test_in_the_terminal_a_figure_is_a_number_a_share_or_why_there_is_none() -> None:
    half = Rate(**proportion(1, 2)._asdict())
    assert spoken_figure(ExtensionFigure(title="t", value=2.0)) == "2.000"
    assert spoken_figure(ExtensionFigure(title="t", value=0.5, rate=half)).startswith("1/2  50.0 %")
    assert spoken_figure(ExtensionFigure(title="t", value=None, problem="KeyError: x")) == "failed: KeyError: x"
