"""`logisticsvln`, whole: the orchestrator's commands, and those of the task set and the evaluation.

The orchestrator knows nothing of the evaluation; here the two are put under one name.
"""

import sys

from orchestrator.cli import app
from vld import tasks_cli
from vld.bench import cli as bench_cli
from vld.evaluate_model.command import evaluate
from vld.report.command import compare, report

app.add_typer(tasks_cli.app, name="tasks")
app.command(name="bench")(bench_cli.bench)
app.command(name="report")(report)
app.command(name="compare")(compare)
app.command(name="evaluate")(evaluate)


def main() -> None:
    """The command line's entry point."""
    sys.exit(app())


if __name__ == "__main__":
    main()
