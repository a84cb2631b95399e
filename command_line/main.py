"""`logisticsvln`: all commands under one name."""

import subprocess
import sys
from pathlib import Path
from typing import Annotated, Literal

import typer
from rich.console import Console
from rich.table import Table

from command_line import bench, tasks
from command_line.deliver import deliver
from command_line.doctor import doctor
from command_line.evaluate import evaluate
from command_line.report import compare, report
from command_line.serve import serve
from orchestrator import sample_library
from service_kit.settings import process_environment

app = typer.Typer(
    name="logisticsvln",
    help="Vision-language drone delivery to a window: from a sentence to a safe stop.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

app.command()(deliver)
app.command()(serve)
app.command()(doctor)


@app.command()
def recording(
    action: Annotated[Literal["export", "import", "check"], typer.Argument(help="What to do with the file.")],
    file: Annotated[Path, typer.Argument(help="The recording.")],
) -> None:
    """Put the gateway's recorded answers (CACHE_PATH or REDIS_URL) into one file, or take them out of one."""
    command = [sys.executable, "-m", "services.vlm_gateway.recording", action, str(file)]
    raise typer.Exit(subprocess.run(command, env=process_environment(), check=False).returncode)


@app.command()
def samples() -> None:
    """List the deliveries that ship with the project."""
    table = Table(box=None, padding=(0, 2), header_style="dim")
    for heading in ("sample", "difficulty", "what", "request"):
        table.add_column(heading, overflow="fold")
    for name in sample_library.names():
        one = sample_library.load(name)
        table.add_row(one.name, one.difficulty, one.title, one.request)
    Console().print(table)


app.add_typer(tasks.app, name="tasks")
app.add_typer(bench.app, name="bench")
app.command()(report)
app.command()(compare)
app.command()(evaluate)


def main() -> None:
    """The command line's entry point."""
    sys.exit(app())


if __name__ == "__main__":
    main()
