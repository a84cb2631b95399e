"""`python -m tests.load.bench_gateway_overload`: three times as many chats as the model can answer.

A model that takes 100 ms for an answer and gives four at a time stands behind the gateway, which lets as many more
wait. First the peak: a closed loop that keeps every place and half of the queue taken. Then requests at three times
that rate, whether or not earlier ones are answered. What is wanted: at least 90 % of the peak is still answered, and
the rest is refused (503 `model_overloaded`) within 50 ms. Latency counts from when a request was due, this process' own
delay included.
"""

import argparse
import asyncio
import json
import os
import statistics
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

import aiohttp

from tests.load.closed_loop import Body, drive
from tests.load.gateway_peers import KEY, mock_server, process
from tests.load.open_loop import Call, Sent, paced
from tests.load.processes import free_port

PLACES = 4
FACTOR = 3.0
REFUSED_WITHIN_S = 0.05


class Overload(NamedTuple):
    """Rates in requests per second, times in milliseconds."""

    peak_per_s: float
    offered_per_s: float
    answered_per_s: float
    of_peak: float
    answered_p99_ms: float
    refused: int
    refused_p50_ms: float
    refused_p99_ms: float
    refused_within_50_ms: float
    anything_else: int


class Flood(NamedTuple):
    sent: list[Sent]
    wall_s: float


def chat(number: object) -> Body:
    message = {"role": "user", "content": f"Request @@ of {number}"}
    before, after = json.dumps({"model": "m", "messages": [message]}).encode().split(b"@@")
    return Body(before, after)


async def over(url: str, rate_per_s: float, seconds: float) -> Flood:
    body = chat("the flood")

    def call(number: int) -> Call:
        return Call("POST", url + "/v1/chat/completions", body.before + str(number).encode() + body.after)

    async with aiohttp.ClientSession(connector=aiohttp.TCPConnector(limit=0)) as session:
        await paced(session, call, rate_per_s / FACTOR, int(rate_per_s / FACTOR))  # connections and code are warm then
        started = time.perf_counter()
        sent = await paced(session, call, rate_per_s, int(rate_per_s * seconds))
        return Flood(sent, time.perf_counter() - started)


def run(seconds: float, answer_ms: float) -> Overload:
    cores = sorted(os.sched_getaffinity(0))
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        os.sched_setaffinity(0, {cores[-1]})
        mock = stack.enter_context(mock_server(cores[-1], answer_ms))
        config = folder / "gateway.toml"
        config.write_text(
            f'[models.m]\nbackend = "chat"\nbase_url = "{mock}/v1"\nmodel = "m"\npreset = "gpt-4o"\n'
            f"concurrency = {PLACES}\nqueue = {PLACES}\n"
        )
        port = free_port()
        environment = {"GATEWAY_CONFIG": str(config), "CACHE_MODE": "off", "PORT": str(port), "HOST": "127.0.0.1"}
        url = f"http://127.0.0.1:{port}"
        command = [sys.executable, "-m", "services.vlm_gateway"]
        stack.enter_context(process("ours", command, url, "/readyz", environment, cores[0]))
        took = drive(url, KEY, chat("the peak"), PLACES + PLACES // 2, seconds, "")
        peak = (len(took.latencies_s) - took.failed) / took.wall_s
        sent, wall_s = asyncio.run(over(url, FACTOR * peak, seconds))
    answered = [one.latency_s * 1000 for one in sent if one.good]
    refused = [one.latency_s * 1000 for one in sent if one.status == 503]
    return Overload(
        peak,
        FACTOR * peak,
        len(answered) / wall_s,
        len(answered) / wall_s / peak,
        _centile(answered, 99),
        len(refused),
        _centile(refused, 50),
        _centile(refused, 99),
        sum(took_ms <= REFUSED_WITHIN_S * 1000 for took_ms in refused) / max(1, len(refused)),
        len(sent) - len(answered) - len(refused),
    )


def _centile(values: list[float], centile: int) -> float:
    return statistics.quantiles(values, n=100)[centile - 1] if len(values) > 1 else float("nan")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=10.0, help="of the peak, and of the flood")
    parser.add_argument("--answer-ms", type=float, default=100.0, help="what the model takes (default: %(default)s)")
    arguments = parser.parse_args()
    found = run(arguments.seconds, arguments.answer_ms)
    sys.stdout.write(
        f"peak      {found.peak_per_s:.1f} answered/s\n"
        f"offered   {found.offered_per_s:.1f}/s\n"
        f"answered  {found.answered_per_s:.1f}/s, {found.of_peak:.1%} of the peak, p99 {found.answered_p99_ms:.0f} ms\n"
        f"refused   {found.refused}, p50 {found.refused_p50_ms:.1f} ms, p99 {found.refused_p99_ms:.1f} ms, "
        f"{found.refused_within_50_ms:.1%} within 50 ms\n"
        f"neither   {found.anything_else}\n"
    )


if __name__ == "__main__":
    main()
