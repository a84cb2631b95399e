"""The stand-in autopilot as a child process of a test."""

import json
import socket
import subprocess
import sys
from collections.abc import Sequence
from types import TracebackType
from typing import Any, Self


class StandIn:
    """Use as a context manager. `told` says one line to it and returns how it is after that."""

    def __init__(
        self, firmware: str = "px4", *, ekf_s: float = 0.2, yaw: float = 0.0, seed: int = 1, more: Sequence[str] = ()
    ) -> None:
        """`more`: options of `python -m tests.autopilot`."""
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind(("127.0.0.1", 0))
            self.port = int(probe.getsockname()[1])
        arguments = ["--port", str(self.port), "--firmware", firmware, "--ekf-s", str(ekf_s), "--seed", str(seed)]
        arguments += ["--yaw", str(yaw), *more]
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.autopilot", *arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )

    @property
    def address(self) -> str:
        """Where MAVSDK is to listen."""
        return f"udpin://127.0.0.1:{self.port}"

    def told(self, what: str = "tell", **more: Any) -> dict[str, Any]:
        process = self._process
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(json.dumps({"do": what, **more}).encode() + b"\n")
        process.stdin.flush()
        return dict(json.loads(process.stdout.readline()))

    def stop(self) -> None:
        self._process.kill()
        self._process.communicate()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()
