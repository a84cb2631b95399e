"""`logisticsvln replay`: the pages over the records in a folder, while they are written or after."""

from pathlib import Path
from typing import Annotated

import typer
import uvicorn

from command_line.console import WRONG_INPUT, stop
from orchestrator.replay_app import build_replay_app
from orchestrator.replays import Replays
from service_kit.addresses import REPLAY_PORT
from service_kit.run import server_config

LOOPBACK = "127.0.0.1"
GRACE_S = 2


def replay(
    folder: Annotated[Path, typer.Argument(help="A run of `bench --pictures`, or a folder of deliveries' records.")],
    port: Annotated[int, typer.Option(min=1, max=65535, help="The port of the loopback to listen at.")] = REPLAY_PORT,
) -> None:
    """Look at the records of a run in the browser, live while it is flown, or afterwards; Ctrl-C ends it."""
    if not folder.is_dir():
        stop(f"{folder} is no folder; name the one that `bench --out` or `RUNS_DIR` writes", WRONG_INPUT)
    typer.echo(f"http://{LOOPBACK}:{port}/")
    uvicorn.Server(server_config(build_replay_app(Replays(folder)), LOOPBACK, port, GRACE_S)).run()
