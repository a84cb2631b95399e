"""`logisticsvln samples`: the deliveries that ship with the project."""

from rich.console import Console
from rich.table import Table

from orchestrator import sample_library


def samples() -> None:
    """List the deliveries that ship with the project."""
    table = Table(box=None, padding=(0, 2), header_style="dim")
    for heading in ("sample", "difficulty", "what", "request"):
        table.add_column(heading, overflow="fold")
    for name in sample_library.names():
        one = sample_library.load(name)
        table.add_row(one.name, one.difficulty, one.title, one.request)
    Console().print(table)
