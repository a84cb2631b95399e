"""The double of CARLA's server as a process: CARLA's client holds the interpreter while it waits for some answers, so
the two can't live in one."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Self

from tests.carla_double.running import HOST, two_free_ports

START_DEADLINE_S = 300.0


class DoubleProcess:
    """`options`: of `python -m tests.carla_double`. Use as a context manager."""

    def __init__(self, log: Path, *options: str, port: int | None = None) -> None:
        self.port = port or two_free_ports()
        self._log = log
        self._options = options
        self._process: subprocess.Popen[bytes] | None = None

    @property
    def address(self) -> str:
        return f"{HOST}:{self.port}"

    def start(self) -> None:
        """Returns when it listens."""
        with self._log.open("wb") as log:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "tests.carla_double", "--port", str(self.port), *self._options],
                stdout=log,
                stderr=log,
            )
        give_up = time.monotonic() + START_DEADLINE_S
        while b"listening" not in self._log.read_bytes():
            assert self._process.poll() is None, self._log.read_text()
            assert time.monotonic() < give_up, "the double did not start"
            time.sleep(0.05)

    def kill(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None

    def pause(self) -> None:
        """It does not answer any more, and its connections stay open."""
        self._signal(signal.SIGSTOP)

    def go_on(self) -> None:
        self._signal(signal.SIGCONT)

    def _signal(self, which: signal.Signals) -> None:
        assert self._process is not None
        os.kill(self._process.pid, which)

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.kill()
