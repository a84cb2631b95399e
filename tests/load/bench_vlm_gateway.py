"""`python -m tests.load.bench_vlm_gateway [--json] [--seconds N]`: what the gateway itself costs.

One gateway process pinned to one core, the load on the other, over real HTTP: typed questions that the cache knows
(SQLite, and Redis where a redis-server is installed) and chats passed on to a mock model server in a third process.
Closed loop at 1 and at 32 connections; requests/s, p50 and p99.
"""

import argparse
import asyncio
import itertools
import json
import multiprocessing
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from multiprocessing.connection import Connection
from pathlib import Path
from typing import NamedTuple

import aiohttp
import numpy as np
from aiohttp import web
from rich.console import Console
from rich.table import Table

from contracts.cameras import default_rig
from contracts.images import JpegImage, encode_jpeg
from contracts.vlm_gateway import FindObjectQuestion, FloorCountQuestion, View
from tests.load.processes import Running, free_port, service

CONNECTIONS = (1, 32)
DIFFERENT = 40
REPLY = {
    "id": "chatcmpl-1",
    "object": "chat.completion",
    "created": 1_700_000_000,
    "model": "mock",
    "choices": [{"index": 0, "message": {"role": "assistant", "content": "hello"}, "finish_reason": "stop"}],
    "usage": {"prompt_tokens": 9, "completion_tokens": 1, "total_tokens": 10},
}
CHAT = {"model": "m", "messages": [{"role": "user", "content": "Say hello."}], "temperature": 1.0}


class Row(NamedTuple):
    """One workload at one number of connections; times in milliseconds. `cpu_ms` is the gateway's processor time a
    request, which says more than requests/s on a busy machine."""

    name: str
    body_bytes: int
    connections: int
    requests_per_s: float
    p50_ms: float
    p99_ms: float
    cpu_ms: float
    failed: int


def picture(side: int, noise: int, seed: int) -> JpegImage:
    """A noisy picture, so that its JPEG has a camera picture's size."""
    chance = np.random.default_rng(seed)
    coarse = chance.integers(0, 255, (side // 8, side // 8, 3)).repeat(8, axis=0).repeat(8, axis=1)
    rgb = np.clip(coarse * 0.3 + 90 + chance.integers(-noise, noise, coarse.shape), 0, 255).astype(np.uint8)
    return encode_jpeg(rgb)


async def drive(
    url: str, path: str, bodies: Sequence[bytes], connections: int, seconds: float
) -> tuple[list[float], int, float]:
    """Each connection asks again as soon as it is answered, the bodies in turn, so that questions under way at the
    same time differ. Latencies in seconds, failures, wall time."""
    took: list[float] = []
    failed = 0
    headers = {"Content-Type": "application/json"}
    async with aiohttp.ClientSession(connector=aiohttp.TCPConnector(limit=connections), headers=headers) as session:
        until, turn = 0.0, itertools.cycle(bodies)

        async def one() -> None:
            nonlocal failed
            while time.perf_counter() < until:
                started = time.perf_counter()
                async with session.post(url + path, data=next(turn)) as response:
                    await response.read()
                    failed += response.status != 200
                took.append(time.perf_counter() - started)

        for body in bodies:  # the first round fills the cache
            async with session.post(url + path, data=body) as response:
                await response.read()
        await asyncio.sleep(0.2)
        until = time.perf_counter() + seconds
        started = time.perf_counter()
        await asyncio.gather(*(one() for _ in range(connections)))
        return took, failed, time.perf_counter() - started


def measure(name: str, gateway: Running, path: str, bodies: Sequence[bytes], seconds: float) -> list[Row]:
    rows = []
    for connections in CONNECTIONS:
        before_s = cpu_s(gateway)
        took, failed, wall_s = asyncio.run(drive(gateway.url, path, bodies, connections, seconds))
        cpu_ms = (cpu_s(gateway) - before_s) * 1000 / (len(took) + len(bodies))
        p50, p99 = np.percentile(took, [50, 99]) * 1000
        rows.append(Row(name, len(bodies[0]), connections, len(took) / wall_s, float(p50), float(p99), cpu_ms, failed))
    return rows


def cpu_s(gateway: Running) -> float:
    """Processor time that the gateway has used so far, in seconds."""
    fields = Path(f"/proc/{gateway.process.pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def serve_mock(ready: Connection) -> None:
    """A model server that answers at once, in a process of its own."""
    body = json.dumps(REPLY).encode()

    async def answer(request: web.Request) -> web.Response:
        await request.read()
        return web.Response(body=body, content_type="application/json")

    async def main() -> None:
        app = web.Application(client_max_size=64 * 1024 * 1024)
        app.router.add_post("/v1/chat/completions", answer)
        runner = web.AppRunner(app, access_log=None)
        await runner.setup()
        await web.TCPSite(runner, "127.0.0.1", 0).start()
        ready.send(runner.addresses[0][1])
        await asyncio.Event().wait()

    asyncio.run(main())


@contextmanager
def mock_server() -> Iterator[str]:
    mine, theirs = multiprocessing.Pipe()
    process = multiprocessing.get_context("spawn").Process(target=serve_mock, args=(theirs,), daemon=True)
    process.start()
    try:
        yield f"http://127.0.0.1:{mine.recv()}/v1"
    finally:
        process.terminate()
        process.join(5)


@contextmanager
def redis_server(folder: str) -> Iterator[str]:
    port = free_port()
    command = ["redis-server", "--port", str(port), "--bind", "127.0.0.1", "--save", "", "--dir", folder]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    try:
        yield f"redis://127.0.0.1:{port}/0"
    finally:
        process.terminate()
        process.wait(10)


def run(seconds: float) -> list[Row]:
    one = [FloorCountQuestion(image=picture(640, 8, n)).model_dump_json().encode() for n in range(DIFFERENT)]
    views = tuple(
        View(camera=camera, image=picture(640, 8, i)) for i, camera in enumerate(default_rig().scaled_to(640).cameras)
    )
    five = [
        FindObjectQuestion(object=f"green flower pot {n}", views=views).model_dump_json().encode()
        for n in range(DIFFERENT)
    ]
    cores = sorted(os.sched_getaffinity(0))
    rows: list[Row] = []
    with ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory())
        mock = stack.enter_context(mock_server())
        config = Path(folder) / "gateway.toml"
        config.write_text(
            f'[models.m]\nbackend = "chat"\nbase_url = "{mock}"\nmodel = "mock"\npreset = "generic-text"\n'
            "concurrency = 64\n"
        )
        stores = {"sqlite": {"CACHE_PATH": str(Path(folder) / "answers.sqlite")}}
        if shutil.which("redis-server"):
            stores["redis"] = {"REDIS_URL": stack.enter_context(redis_server(folder))}
        os.sched_setaffinity(0, set(cores[1:]) or set(cores))
        for store, settings in stores.items():
            environment = {"GATEWAY_CONFIG": str(config), **settings}
            with service("services.vlm_gateway", environment, core=cores[0]) as gateway:
                rows += measure(f"floor-count, {store} hit", gateway, "/v1/floor-count", one, seconds)
                rows += measure(f"find-object, {store} hit", gateway, "/v1/find-object", five, seconds)
                if store == "sqlite":
                    chat = json.dumps(CHAT).encode()
                    rows += measure("small chat, passed on", gateway, "/v1/chat/completions", [chat], seconds)
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", action="store_true", help="one JSON object instead of the table")
    parser.add_argument("--seconds", type=float, default=3.0, help="per workload and number of connections")
    arguments = parser.parse_args()
    rows = run(arguments.seconds)
    if arguments.json:
        sys.stdout.write(json.dumps({"rows": [row._asdict() for row in rows]}) + "\n")
        return
    table = Table(
        "workload",
        "body",
        "connections",
        "requests/s",
        "p50",
        "p99",
        "CPU a request",
        "failed",
        title="vlm_gateway, one core",
    )
    for row in rows:
        size = f"{row.body_bytes / 1000:.0f} kB"
        times = (f"{row.p50_ms:.2f} ms", f"{row.p99_ms:.2f} ms", f"{row.cpu_ms:.2f} ms")
        table.add_row(row.name, size, str(row.connections), f"{row.requests_per_s:.0f}", *times, str(row.failed))
    Console().print(table)


if __name__ == "__main__":
    main()
