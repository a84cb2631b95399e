"""An open-loop load generator: requests leave at their scheduled times whether or not earlier ones came back.

Latency counts from the scheduled time, so that a stalled server can't hide its queue. Bounded in count and time.
"""

import asyncio
import time
from collections.abc import Callable
from typing import NamedTuple

import aiohttp
import numpy as np

TIMEOUT_S = 30.0


class Call(NamedTuple):
    """One HTTP call, ready to send."""

    method: str
    url: str
    body: bytes | None = None


class Sent(NamedTuple):
    """What became of one request: its status (0 where no answer came) and the time since it was due."""

    status: int
    latency_s: float

    @property
    def good(self) -> bool:
        return 200 <= self.status < 300


class Load(NamedTuple):
    """What a run measured: milliseconds, requests per second, how many did not end in 2xx."""

    offered_per_s: float
    done_per_s: float
    requests: int
    failed: int
    p50_ms: float
    p95_ms: float
    p99_ms: float


async def alone(session: aiohttp.ClientSession, call: Callable[[int], Call], count: int) -> Load:
    """One request after another on one connection."""
    latencies, failed = [], 0
    started = time.perf_counter()
    for i in range(count):
        before = time.perf_counter()
        failed += not 200 <= await _send(session, call(i)) < 300
        latencies.append(time.perf_counter() - before)
    return _summary(0.0, latencies, failed, time.perf_counter() - started)


async def open_loop(session: aiohttp.ClientSession, call: Callable[[int], Call], rate_per_s: float, count: int) -> Load:
    """`count` requests at `rate_per_s`, evenly spaced."""
    started = time.perf_counter()
    sent = await paced(session, call, rate_per_s, count)
    wall_s = time.perf_counter() - started
    return _summary(rate_per_s, [one.latency_s for one in sent], sum(not one.good for one in sent), wall_s)


async def paced(
    session: aiohttp.ClientSession, call: Callable[[int], Call], rate_per_s: float, count: int
) -> list[Sent]:
    """The same, every request told apart."""
    started = time.perf_counter() + 0.05

    async def one(i: int) -> Sent:
        due = started + i / rate_per_s
        await asyncio.sleep(max(0.0, due - time.perf_counter()))
        status = await _send(session, call(i))
        return Sent(status, time.perf_counter() - due)

    return await asyncio.gather(*(one(i) for i in range(count)))


async def _send(session: aiohttp.ClientSession, call: Call) -> int:
    """The answer's status, 0 where none came."""
    headers = {"Content-Type": "application/json"} if call.body is not None else {}
    limit = aiohttp.ClientTimeout(total=TIMEOUT_S)
    try:
        async with session.request(call.method, call.url, data=call.body, headers=headers, timeout=limit) as response:
            await response.read()
            return response.status
    except (aiohttp.ClientError, TimeoutError, OSError):
        return 0


def _summary(offered: float, latencies_s: list[float], failed: int, wall_s: float) -> Load:
    p50, p95, p99 = (float(v) for v in np.percentile(np.array(latencies_s) * 1000, [50, 95, 99]))
    return Load(offered, len(latencies_s) / wall_s, len(latencies_s), failed, p50, p95, p99)
