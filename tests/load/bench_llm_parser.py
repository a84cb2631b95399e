"""Latency of `POST /v1/parse` with the learned reader over HTTP: `python -m tests.load.bench_llm_parser [--json]`.

Starts the service as a process and sends requests one after the other on one connection. `in process` is the reader
alone, without HTTP; `cpu_ms` is the service's own processor time per request, which other load on the
machine changes less than the latencies.
"""

import argparse
import asyncio
import json
import os
import sys
import time
from pathlib import Path

import aiohttp
import numpy as np

from contracts.llm_parser import ParseQuestion
from services.llm_parser.reader.model import ReaderModel
from services.llm_parser.reader.parser import WEIGHTS, ReaderParser
from tests.load.open_loop import Call, alone
from tests.load.processes import service

REQUESTS = Path(__file__).parents[1] / "data" / "requests_kept_apart.jsonl"


def in_process(requests: list[str]) -> dict[str, float]:
    """Milliseconds of the reader alone, over all requests, after one round of warming up."""
    parser = ReaderParser(ReaderModel(WEIGHTS))
    questions = [ParseQuestion(request=request) for request in requests]
    for question in questions:
        parser.read(question)
    took = []
    for question in questions:
        started = time.perf_counter()
        parser.read(question)
        took.append(1000 * (time.perf_counter() - started))
    p50, p95, p99 = np.percentile(took, (50, 95, 99))
    return {"requests": len(took), "p50_ms": round(p50, 3), "p95_ms": round(p95, 3), "p99_ms": round(p99, 3)}


async def over_http(requests: list[str], count: int) -> dict[str, float]:
    """Milliseconds over real HTTP, one request at a time."""
    bodies = [ParseQuestion(request=request).model_dump_json().encode() for request in requests]
    with service("services.llm_parser", {"PARSER_BACKEND": "reader"}) as running:
        url = f"{running.url}/v1/parse"
        async with aiohttp.ClientSession() as session:
            await alone(session, lambda i: Call("POST", url, bodies[i % len(bodies)]), len(bodies))
            before = _cpu_s(running.process.pid)
            load = await alone(session, lambda i: Call("POST", url, bodies[i % len(bodies)]), count)
            cpu_ms = 1000 * (_cpu_s(running.process.pid) - before) / count
    return {
        "requests": load.requests,
        "failed": load.failed,
        "per_s": round(load.done_per_s, 1),
        "p50_ms": round(load.p50_ms, 3),
        "p95_ms": round(load.p95_ms, 3),
        "p99_ms": round(load.p99_ms, 3),
        "cpu_ms": round(cpu_ms, 3),
    }


def _cpu_s(pid: int) -> float:
    """Processor time of a process so far, from the kernel."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def main() -> None:
    """Print the figures, or one JSON object."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true", help="one JSON object instead of text")
    parser.add_argument("--count", type=int, default=1000, help="requests over HTTP")
    options = parser.parse_args()
    requests = [json.loads(line)["text"] for line in REQUESTS.read_text(encoding="utf-8").splitlines()]
    figures = {"http": asyncio.run(over_http(requests, options.count)), "in_process": in_process(requests)}
    if options.json:
        sys.stdout.write(json.dumps(figures) + "\n")
        return
    for name, row in figures.items():
        sys.stdout.write(f"{name:<11}" + "  ".join(f"{key} {value}" for key, value in row.items()) + "\n")


if __name__ == "__main__":
    main()
