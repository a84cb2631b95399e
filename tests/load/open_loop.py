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
        failed += not await _send(session, call(i))
        latencies.append(time.perf_counter() - before)
    return _summary(0.0, latencies, failed, time.perf_counter() - started)


async def open_loop(session: aiohttp.ClientSession, call: Callable[[int], Call], rate_per_s: float, count: int) -> Load:
    """`count` requests at `rate_per_s`, evenly spaced."""
    latencies = [0.0] * count
    failures = [0] * count
    started = time.perf_counter() + 0.05

    async def one(i: int) -> None:
        due = started + i / rate_per_s
        await asyncio.sleep(max(0.0, due - time.perf_counter()))
        failures[i] = not await _send(session, call(i))
        latencies[i] = time.perf_counter() - due

    await asyncio.gather(*(one(i) for i in range(count)))
    return _summary(rate_per_s, latencies, sum(failures), time.perf_counter() - started)


async def _send(session: aiohttp.ClientSession, call: Call) -> bool:
    headers = {"Content-Type": "application/json"} if call.body is not None else {}
    limit = aiohttp.ClientTimeout(total=TIMEOUT_S)
    try:
        async with session.request(call.method, call.url, data=call.body, headers=headers, timeout=limit) as response:
            await response.read()
            return 200 <= response.status < 300
    except (aiohttp.ClientError, TimeoutError, OSError):
        return False


def _summary(offered: float, latencies_s: list[float], failed: int, wall_s: float) -> Load:
    p50, p95, p99 = (float(v) for v in np.percentile(np.array(latencies_s) * 1000, [50, 95, 99]))
    return Load(offered, len(latencies_s) / wall_s, len(latencies_s), failed, p50, p95, p99)
