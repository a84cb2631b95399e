"""`make bench-gateway`: vlm_gateway and LiteLLM's proxy side by side, one worker each on one core, against one mock.

Both check a key; ours has everything on: budgets, cache in Redis, retries, figures, log. Four workloads, every body
another one but for the last:

    A  a small text    B  one picture of 130 kB    C  five of them    D  B again and again, out of the cache in Redis

Closed loops at 1, 8 and 32 connections; medians of alternated runs, in each of which all others stand still; latency is
what a gateway adds to the mock alone. CPU is the gateway's own, user and system: the figure that other people's load on
the machine disturbs least. The start that is timed is the second one: in the first after an installation Python
compiles what it reads.
"""

import argparse
import base64
import json
import os
import random
import signal
import statistics
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import NamedTuple
from urllib.request import urlopen

from rich.console import Console
from rich.table import Table

from tests.load.bench_vlm_gateway import redis_server
from tests.load.closed_loop import Body, drive
from tests.load.gateway_peers import KEY, Peer, cpu_s, install_litellm, litellm, machine_cpu_s, mock_server, ours, tree

CONNECTIONS = (1, 8, 32)
PICTURE_BYTES = 97_500  # 130 kB in base64
GOALS = {"A": "4000/s", "B": "1800/s, p50 +0.8 ms", "C": "2.0 ms CPU", "D": "2700/s"}


class Cell(NamedTuple):
    """One run of one workload; `elsewhere` is what others used of the machine meanwhile, in cores."""

    peer: str
    workload: str
    connections: int
    requests_per_s: float
    p50_ms: float
    p99_ms: float
    cpu_ms: float
    failed: int
    asked_upstream: float
    elsewhere: float


def jpeg_base64(seed: int) -> str:
    """A picture's header (800 x 800) and chance for its pixels: gateways look at the one and carry the other."""
    head = b"\xff\xd8\xff\xe0\x00\x10JFIF\x00\x01\x01\x00\x00\x01\x00\x01\x00\x00\xff\xdb\x00\x43\x00" + b"\x10" * 64
    head += b"\xff\xc0\x00\x11\x08\x03\x20\x03\x20\x03\x01\x22\x00\x02\x11\x00\x03\x11\x00"
    head += b"\xff\xda\x00\x0c\x03\x01\x00\x02\x11\x03\x11\x00\x3f\x00"
    pixels = random.Random(seed).randbytes(PICTURE_BYTES - len(head) - 2).replace(b"\xff", b"\xfe")
    return base64.b64encode(head + pixels + b"\xff\xd9").decode()


def body(workload: str) -> Body:
    """A chat at temperature 0, so that it is looked up in the cache wherever there is one. S is A as a stream."""
    pictures = {"A": 0, "B": 1, "C": 5, "D": 1, "S": 0}[workload]
    content: list[dict[str, object]] = [{"type": "text", "text": "Request @@: how many floors are below the window?"}]
    for seed in range(pictures):
        url = f"data:image/jpeg;base64,{jpeg_base64(seed)}"
        content.append({"type": "image_url", "image_url": {"url": url}})
    words = content if pictures else "Request @@: deliver the parcel to the third floor, left of the red awning."
    messages = [{"role": "user", "content": words}]
    chat: dict[str, object] = {"messages": messages, "model": "mock", "temperature": 0, "max_tokens": 128}
    if workload == "S":
        chat |= {"model": "mock-stream", "stream": True}
    before, after = json.dumps(chat, separators=(",", ":")).encode().split(b"@@")
    return Body(before, after, unique=workload != "D")


def asked(mock: str) -> int:
    with urlopen(mock + "/stats", timeout=5) as answer:
        return int(json.load(answer)["answered"])


@contextmanager
def alone(peer: Peer, peers: Sequence[Peer]) -> Iterator[None]:
    """All other peers are stopped meanwhile: some take time with nothing to do, on the core that is shared."""
    others = tree([pid for other in peers if other is not peer for pid in other.roots])
    for pid in others:
        os.kill(pid, signal.SIGSTOP)
    try:
        time.sleep(0.2)
        yield
    finally:
        for pid in others:
            os.kill(pid, signal.SIGCONT)


def measure(peer: Peer, workload: str, connections: int, seconds: float, mock: str, helpers: set[int]) -> Cell:
    pids = tree(peer.roots)
    one = body(workload)
    if workload == "D":  # the first fills the cache, which may take a moment
        for _ in range(3):
            drive(peer.url, KEY, one, 1, 0.05, "")
            time.sleep(0.2)
    upstream, cpu, helped, machine = asked(mock), cpu_s(pids), cpu_s(helpers), machine_cpu_s()
    took = drive(peer.url, KEY, one, connections, seconds, f"{random.getrandbits(48):x}-")
    count = len(took.latencies_s)
    used = cpu_s(pids) - cpu
    others = machine_cpu_s() - machine - used - (cpu_s(helpers) - helped)
    centiles = statistics.quantiles(took.latencies_s, n=100) if count > 1 else [took.latencies_s[0]] * 99
    return Cell(
        peer.name,
        workload,
        connections,
        count / took.wall_s,
        centiles[49] * 1000,
        centiles[98] * 1000,
        used * 1000 / count,
        took.failed,
        (asked(mock) - upstream) / count,
        max(0.0, others) / took.wall_s,
    )


class Result(NamedTuple):
    peers: list[Peer]
    cells: list[Cell]


def run(workloads: str, seconds: float, repeats: int, with_litellm: bool) -> Result:
    cores = sorted(os.sched_getaffinity(0))
    front, back = cores[0], cores[-1]
    cells: list[Cell] = []
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        os.sched_setaffinity(0, {back})
        mock = stack.enter_context(mock_server(back))
        redis = stack.enter_context(redis_server(str(folder)))
        helpers = tree([os.getpid()])
        passing = [Peer("the mock alone", mock), ours(stack, folder, mock, redis, front)]
        caching = [passing[1]]
        if with_litellm:
            passing.append(litellm(stack, folder, mock, None, front))
            if "D" in workloads:
                caching.append(litellm(stack, folder, mock, redis, front))
        everybody = [*passing, *caching[1:]]
        for peer in everybody:
            for workload in "AB":
                drive(peer.url, KEY, body(workload), 4, 1.0, "warm-")
        for repeat in range(repeats):
            for workload in workloads:
                peers = caching if workload == "D" else passing
                for connections in CONNECTIONS:
                    for turn in range(len(peers)):
                        peer = peers[(turn + repeat) % len(peers)]
                        with alone(peer, everybody):
                            cells.append(measure(peer, workload, connections, seconds, mock, helpers))
                        sys.stderr.write(f"\r{repeat + 1}/{repeats} {workload} {connections:>2} {peer.name:<16}")
        sys.stderr.write("\r" + " " * 60 + "\r")
        return Result(everybody, cells)


def median(result: Result, peer: str, workload: str, connections: int, name: str) -> float | None:
    values = [
        float(getattr(cell, name))
        for cell in result.cells
        if (cell.peer, cell.workload, cell.connections) == (peer, workload, connections)
    ]
    return statistics.median(values) if values else None


def show(result: Result, workloads: str) -> None:
    console = Console(width=140)
    table = Table(title="one worker on one core; medians", title_justify="left")
    for column in ("", "gateway", "requests/s at 32", "x LiteLLM", "CPU a request", "added p50/p99 at 1", "at 8"):
        table.add_column(column, justify="left" if column in ("", "gateway") else "right")
    for column in ("asked upstream", "failed", "goal"):
        table.add_column(column, justify="right")
    for workload in workloads:
        peers = [p.name for p in result.peers if median(result, p.name, workload, 1, "p50_ms") is not None]
        for peer in peers:
            rate = median(result, peer, workload, 32, "requests_per_s") or 0.0
            baseline = median(result, "litellm+cache" if workload == "D" else "litellm", workload, 32, "requests_per_s")
            alone = peer == "the mock alone"
            added = [_added(result, peer, workload, connections) for connections in (1, 8)]
            cpu = median(result, peer, workload, 32, "cpu_ms")
            table.add_row(
                workload,
                peer,
                f"{rate:.0f}",
                f"{rate / baseline:.1f}" if baseline and not alone else "",
                "" if alone else f"{cpu:.3f} ms",
                *added,
                f"{median(result, peer, workload, 32, 'asked_upstream'):.2f}",
                str(sum(cell.failed for cell in result.cells if (cell.peer, cell.workload) == (peer, workload))),
                GOALS[workload] if peer == "ours" else "",
            )
        table.add_section()
    console.print(table)
    for one in result.peers:
        if one.start_s is not None:
            console.print(f"{one.name}: {one.idle_mb:.0f} MB idle, started in {one.start_s:.2f} s")
    elsewhere = statistics.median(cell.elsewhere for cell in result.cells)
    console.print(f"used by others meanwhile: {elsewhere:.2f} cores of {os.cpu_count()}")


def _added(result: Result, peer: str, workload: str, connections: int) -> str:
    base = "B" if workload == "D" else workload
    parts = []
    for name in ("p50_ms", "p99_ms"):
        value = median(result, peer, workload, connections, name)
        direct = median(result, "the mock alone", base, connections, name)
        if value is None or direct is None:
            return ""
        parts.append(f"{value:.2f}" if peer == "the mock alone" else f"{value - direct:.2f}")
    return f"({'/'.join(parts)})" if peer == "the mock alone" else "/".join(parts) + " ms"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", action="store_true", help="one JSON object instead of the table")
    parser.add_argument("--seconds", type=float, default=6.0, help="per run (default: %(default)s)")
    parser.add_argument("--repeats", type=int, default=3, help="runs of which the median is taken")
    parser.add_argument("--workloads", default="ABCD")
    parser.add_argument("--without-litellm", action="store_true", help="ours and the mock only")
    arguments = parser.parse_args()
    if not arguments.without_litellm:
        install_litellm()
    result = run(arguments.workloads, arguments.seconds, arguments.repeats, not arguments.without_litellm)
    if arguments.json:
        whole = {"peers": [p._asdict() for p in result.peers], "cells": [c._asdict() for c in result.cells]}
        sys.stdout.write(json.dumps(whole) + "\n")
    else:
        show(result, arguments.workloads)


if __name__ == "__main__":
    main()
