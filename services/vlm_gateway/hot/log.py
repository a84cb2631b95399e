"""One JSON line a request, for a share of them; those that failed always, up to a bound. Written in batches."""

import asyncio
import json
import random
import sys
import time
from typing import TextIO

from service_kit.running_loop import running_loop

FLUSH_EVERY_S = 0.5
MAX_FAILED_PER_FLUSH = 20


class RequestLog:
    """Lines hold names and numbers only: no bodies, no headers, no keys. `share` of the answered requests, 0..1."""

    def __init__(self, share: float, sink: TextIO | None = None) -> None:
        self._share = share
        self._sink = sink
        self._lines: list[str] = []
        self._failed = 0
        self._left_out = 0
        self._timer: asyncio.TimerHandle | None = None

    def wants(self, status: int) -> bool:
        """Whether a request that ended so is to be written down."""
        if self._share <= 0.0:
            return False
        if status < 500:
            return random.random() < self._share
        self._failed += 1
        if self._failed > MAX_FAILED_PER_FLUSH:
            self._left_out += 1
            self._later()
            return False
        return True

    def add(self, **facts: str | int | float | None) -> None:
        """`facts` go into the line as they are."""
        now = time.time()
        stamp = time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(now)) + f".{int(now % 1 * 1000):03d}Z"
        line = {"time": stamp, "level": "info", "logger": "vlm_gateway.requests", **facts}
        self._lines.append(json.dumps(line))
        self._later()

    def flush(self) -> None:
        """Write what has come together."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if self._left_out:
            left_out, self._left_out = self._left_out, 0
            self._failed = 0
            self.add(message=f"{left_out} more failed requests left out")
            if self._timer is not None:
                self._timer.cancel()
                self._timer = None
        self._failed = 0
        if self._lines:
            text = "\n".join(self._lines) + "\n"
            self._lines.clear()
            (self._sink or sys.stderr).write(text)

    def _later(self) -> None:
        if self._timer is None:
            self._timer = running_loop().call_later(FLUSH_EVERY_S, self.flush)
