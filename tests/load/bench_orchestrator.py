"""How fast a burst of deliveries is taken, and what a fleet costs that waits.

    python -m tests.load.bench_orchestrator --posts 10000 --callers 4
    python -m tests.load.bench_orchestrator --posts 10000 --rate 200
    python -m tests.load.bench_orchestrator --posts 1000 --idle

A real orchestrator on SQLite, or on `--database`; its parser and gateway answer at once, and its simulator is away, so
that every delivery is read and then waits for a vehicle.
"""

import argparse
import asyncio
import os
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

import aiohttp
import httpx
import uvicorn
from fastapi import FastAPI

from contracts.llm_parser import ParseAnswer, ParseQuestion
from contracts.vlm_gateway import PreflightAnswer, PreflightQuestion
from service_kit.addresses import Addresses
from tests.load.processes import free_port
from tests.system.orchestrator_process import OrchestratorProcess

IDLE_S = 20.0


def services() -> str:
    """The address of a parser and a gateway that answer at once."""
    app = FastAPI()

    @app.post("/v1/parse")
    async def parse(question: ParseQuestion) -> ParseAnswer:
        return ParseAnswer(floor=4, object="green flower pot", missing=(), evidence={}, model="fixed")

    @app.post("/v1/preflight")
    async def preflight(question: PreflightQuestion) -> PreflightAnswer:
        return PreflightAnswer(model="fixed", backend="fixed", known=True)

    port = free_port()
    server = uvicorn.Server(uvicorn.Config(app, port=port, log_level="error"))
    threading.Thread(target=server.run, daemon=True).start()
    return f"http://127.0.0.1:{port}"


async def burst(url: str, posts: int, callers: int, rate_per_s: float) -> tuple[list[float], float]:
    """Seconds that each post took, and all of them together. Each of so many callers posts one after the other; with a
    rate posts leave at their times, whether or not earlier ones have been answered, and count from then."""
    took: list[float] = []
    todo = iter(range(posts))
    connections = aiohttp.TCPConnector(limit=0 if rate_per_s else callers)
    async with aiohttp.ClientSession(base_url=url, connector=connections) as client:

        async def post(number: int, due: float) -> None:
            body = {"sample": "green-flower-pot", "priority": number % 10}
            async with client.post(
                "/v1/deliveries", json=body, headers={"Idempotency-Key": f"burst {number}"}
            ) as answer:
                assert answer.status == 202, await answer.text()
                await answer.read()
            took.append(time.perf_counter() - due)

        async def call() -> None:
            for number in todo:
                await post(number, time.perf_counter())

        async def punctually(number: int, due: float) -> None:
            await asyncio.sleep(max(0.0, due - time.perf_counter()))
            await post(number, due)

        began = time.perf_counter()
        if rate_per_s:
            await asyncio.gather(*(punctually(number, began + number / rate_per_s) for number in todo))
        else:
            await asyncio.gather(*(call() for _ in range(callers)))
        return took, time.perf_counter() - began


def count(url: str) -> int:
    """Deliveries that the list shows, page by page."""
    found, before = 0, None
    while True:
        more = {} if before is None else {"before": before}
        page: dict[str, Any] = httpx.get(f"{url}/v1/deliveries", params={"limit": 1000} | more, timeout=60).json()
        found += len(page["deliveries"])
        before = page["next"]
        if before is None:
            return found


def cpu_s(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def rss_mb(pid: int) -> float:
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


def wait_until_read(url: str) -> None:
    """Returns when the delivery that is read last, the newest of the lowest priority, has been read."""
    newest = httpx.get(f"{url}/v1/deliveries", params={"limit": 100}, timeout=60).json()["deliveries"]
    last = min(newest, key=lambda delivery: delivery["priority"])["id"]
    with httpx.stream("GET", f"{url}/v1/deliveries/{last}/events", timeout=600) as answer:
        next(line for line in answer.iter_lines() if '"kind":"parsed"' in line)


def idle_share(pid: int) -> float:
    """The share of a core that the process takes while everything waits."""
    time.sleep(IDLE_S / 4)
    began, used = time.perf_counter(), cpu_s(pid)
    time.sleep(IDLE_S)
    return (cpu_s(pid) - used) / (time.perf_counter() - began)


def say(line: str) -> None:
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--posts", type=int, default=10_000)
    parser.add_argument("--callers", type=int, default=4)
    parser.add_argument("--rate", type=float, default=0.0, help="posts a second, however many are under way")
    parser.add_argument("--idle", action="store_true", help="wait until all are read, and measure what they cost then")
    parser.add_argument("--database", help="postgresql://...; SQLite without it")
    asked = parser.parse_args()
    at = services()
    with tempfile.TemporaryDirectory() as folder:
        settings = {} if asked.database is None else {"DATABASE_URL": asked.database}
        away = f"http://127.0.0.1:{free_port()}"
        addresses = Addresses(llm_parser=at, vlm_gateway=at, depth_assist=at, sim=away)
        orchestrator = OrchestratorProcess(addresses, Path(folder) / "runs", settings)
        orchestrator.start()
        try:
            before = rss_mb(orchestrator.pid)
            took, seconds = asyncio.run(burst(orchestrator.url, asked.posts, asked.callers, asked.rate))
            took.sort()
            p50, p99 = (1000 * took[int(q * (len(took) - 1))] for q in (0.5, 0.99))
            kept = count(orchestrator.url)
            how = f"at {asked.rate:g}/s" if asked.rate else f"by {asked.callers} callers"
            say(f"{asked.posts} posts {how}: {asked.posts / seconds:.0f}/s")
            say(f"p50 {p50:.1f} ms, p99 {p99:.1f} ms, {kept} kept, RSS +{rss_mb(orchestrator.pid) - before:.0f} MB")
            if not asked.idle:
                return
            wait_until_read(orchestrator.url)
            share = idle_share(orchestrator.pid)
            say(f"{kept} waiting: {100 * share:.1f} % of a core, RSS {rss_mb(orchestrator.pid):.0f} MB")
        finally:
            orchestrator.kill()


if __name__ == "__main__":
    main()
