"""`logisticsvln recording`: the gateway's recorded answers as one file."""

import subprocess
import sys
from pathlib import Path
from typing import Annotated, Literal

import typer

from service_kit.settings import process_environment


def recording(
    action: Annotated[Literal["export", "import", "check"], typer.Argument(help="What to do with the file.")],
    file: Annotated[Path, typer.Argument(help="The recording.")],
) -> None:
    """Put the gateway's recorded answers (CACHE_PATH or REDIS_URL) into one file, or take them out of one."""
    command = [sys.executable, "-m", "services.vlm_gateway.recording", action, str(file)]
    raise typer.Exit(subprocess.run(command, env=process_environment(), check=False).returncode)
