"""An orchestrator's process that begins with everything imported: what `python -m orchestrator` does, after a fork."""

import os
import sys
from collections.abc import Mapping
from pathlib import Path

from orchestrator.bootstrap import bootstrap
from orchestrator.settings import OrchestratorSettings
from service_kit.run import main


def run_orchestrator(environment: Mapping[str, str], log: Path) -> None:
    """In a session of its own, with that environment and its words in `log`, until it is ended."""
    os.setsid()
    os.closerange(3, 256)  # one of these keeps the process from which it is forked alive when the tests have ended
    os.environ.clear()
    os.environ.update(environment)
    os.environ["PARENT_PID"] = str(os.getppid())  # ends with the tests, as the process does from which it is forked
    with log.open("ab") as file:
        os.dup2(file.fileno(), sys.stdout.fileno())
        os.dup2(file.fileno(), sys.stderr.fileno())
    main("orchestrator", OrchestratorSettings, bootstrap)
