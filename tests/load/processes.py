"""The real services as processes on free ports, each pinned to one core, for load and benchmarks."""

import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple
from urllib.error import URLError
from urllib.request import urlopen

READY_WITHIN_S = 60.0


class Running(NamedTuple):
    """A service that answers at `url`."""

    url: str
    process: subprocess.Popen[bytes]


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@contextmanager
def service(module: str, environment: Mapping[str, str] | None = None, core: int | None = None) -> Iterator[Running]:
    """`python -m module`, ready; ended on leaving. Its log is shown if it does not get ready."""
    port = free_port()
    given = os.environ | {"PORT": str(port), "HOST": "127.0.0.1", "LOG_LEVEL": "warning"} | dict(environment or {})
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log"
        with log.open("wb") as sink:
            process = subprocess.Popen([sys.executable, "-m", module], env=given, stdout=sink, stderr=sink)
        if core is not None:
            os.sched_setaffinity(process.pid, {core})
        url = f"http://127.0.0.1:{port}"
        try:
            _wait_until_ready(url, process, log)
            yield Running(url, process)
        finally:
            process.terminate()
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def _wait_until_ready(url: str, process: subprocess.Popen[bytes], log: Path) -> None:
    give_up = time.monotonic() + READY_WITHIN_S
    while time.monotonic() < give_up:
        if process.poll() is not None:
            raise SystemExit(f"the service ended with status {process.returncode}:\n{log.read_text()[-2000:]}")
        try:
            with urlopen(f"{url}/readyz", timeout=3) as answer:
                if answer.status == 200:
                    return
        except (URLError, OSError):
            time.sleep(0.05)
    raise SystemExit(f"not ready within {READY_WITHIN_S:g} s:\n{log.read_text()[-2000:]}")
