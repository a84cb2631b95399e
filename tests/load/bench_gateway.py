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
import hashlib
import json
import os
import random
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import NamedTuple
from urllib.request import Request, urlopen

from rich.console import Console
from rich.table import Table

from tests.load.bench_vlm_gateway import redis_server
from tests.load.closed_loop import Body, drive
from tests.load.processes import free_port

ROOT = Path(__file__).parent.parent.parent
LITELLM = ROOT / ".cache" / "litellm"
LITELLM_VERSION = "1.106.2"
KEY = "sk-bench"
CONNECTIONS = (1, 8, 32)
PICTURE_BYTES = 97_500  # 130 kB in base64
GOALS = {"A": "4000/s", "B": "1800/s, p50 +0.8 ms", "C": "2.0 ms CPU", "D": "2700/s"}


class Peer(NamedTuple):
    """One server under load; without a process it is the mock itself. `roots` are the processes whose CPU counts."""

    name: str
    url: str
    roots: tuple[int, ...] = ()
    start_s: float | None = None
    idle_mb: float | None = None


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
    """A chat at temperature 0, so that it is looked up in the cache wherever there is one."""
    pictures = {"A": 0, "B": 1, "C": 5, "D": 1}[workload]
    content: list[dict[str, object]] = [{"type": "text", "text": "Request @@: how many floors are below the window?"}]
    for seed in range(pictures):
        url = f"data:image/jpeg;base64,{jpeg_base64(seed)}"
        content.append({"type": "image_url", "image_url": {"url": url}})
    words = content if pictures else "Request @@: deliver the parcel to the third floor, left of the red awning."
    messages = [{"role": "user", "content": words}]
    chat = {"messages": messages, "model": "mock", "temperature": 0, "max_tokens": 128}
    before, after = json.dumps(chat, separators=(",", ":")).encode().split(b"@@")
    return Body(before, after, unique=workload != "D")


def tree(roots: Sequence[int]) -> set[int]:
    """These processes and all below them."""
    children: dict[int, list[int]] = {}
    for folder in Path("/proc").iterdir():
        if folder.name.isdigit():
            try:
                parent = int((folder / "stat").read_text().rsplit(")", 1)[1].split()[1])
            except (OSError, IndexError):
                continue
            children.setdefault(parent, []).append(int(folder.name))
    found, left = set(), list(roots)
    while left:
        pid = left.pop()
        if pid not in found:
            found.add(pid)
            left += children.get(pid, [])
    return found


def cpu_s(pids: set[int]) -> float:
    """Processor time used so far, user and system."""
    ticks = 0
    for pid in pids:
        try:
            fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
        except OSError:
            continue
        ticks += int(fields[11]) + int(fields[12])
    return ticks / os.sysconf("SC_CLK_TCK")


def machine_cpu_s() -> float:
    """Processor time that everybody has used so far."""
    fields = [int(field) for field in Path("/proc/stat").read_text().splitlines()[0].split()[1:9]]
    return sum(fields[i] for i in (0, 1, 2, 5, 6, 7)) / os.sysconf("SC_CLK_TCK")


def resident_mb(pids: set[int]) -> float:
    total = 0
    for pid in pids:
        for line in Path(f"/proc/{pid}/status").read_text().splitlines():
            if line.startswith("VmRSS:"):
                total += int(line.split()[1])
    return total / 1024


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


@contextmanager
def process(
    name: str, command: list[str], url: str, ready: str, environment: dict[str, str], core: int, within_s: float = 180.0
) -> Iterator[Peer]:
    """A server pinned to one core, once it answers at `ready`; ended on leaving."""
    with tempfile.TemporaryFile() as log:
        started = time.perf_counter()
        child = subprocess.Popen(
            ["taskset", "-c", str(core), *command], env=os.environ | environment, stdout=log, stderr=log
        )
        try:
            while True:
                try:
                    with urlopen(Request(url + ready, headers={"Authorization": f"Bearer {KEY}"}), timeout=5):
                        break
                except OSError:
                    late = time.perf_counter() - started > within_s
                    if child.poll() is not None or late:
                        log.seek(0)
                        raise SystemExit(f"{name} did not start:\n{log.read()[-3000:].decode()}") from None
                    time.sleep(0.01)
            start_s = time.perf_counter() - started
            time.sleep(1.0)
            yield Peer(name, url, (child.pid,), start_s, resident_mb(tree([child.pid])))
        finally:
            child.terminate()
            try:
                child.wait(20)
            except subprocess.TimeoutExpired:
                child.kill()
                child.wait()


@contextmanager
def second_start(
    name: str, command: list[str], url: str, ready: str, environment: dict[str, str], core: int
) -> Iterator[Peer]:
    """As every start is but the first after an installation, in which Python compiles what it reads."""
    environment = {**environment, "PYTHONDONTWRITEBYTECODE": ""}
    with process(name, command, url, ready, environment, core):
        pass
    with process(name, command, url, ready, environment, core) as peer:
        yield peer


@contextmanager
def mock_server(core: int, after_ms: float = 0.0) -> Iterator[str]:
    command = ["taskset", "-c", str(core), sys.executable, "-m", "tests.load.chat_mock", "0", str(after_ms)]
    child = subprocess.Popen(command, stdout=subprocess.PIPE, cwd=ROOT)
    assert child.stdout is not None
    try:
        yield f"http://127.0.0.1:{int(child.stdout.readline())}"
    finally:
        child.terminate()
        child.wait(10)


def ours(stack: ExitStack, folder: Path, mock: str, redis: str, core: int) -> Peer:
    config = folder / "gateway.toml"
    digest = hashlib.sha256(KEY.encode()).hexdigest()
    config.write_text(
        f'[models.mock]\nbackend = "chat"\nbase_url = "{mock}/v1"\nmodel = "maker/mock-1"\npreset = "gpt-4o"\n'
        "concurrency = 64\nusd_per_million_prompt = 1.0\nusd_per_million_completion = 2.0\n\n"
        f'[keys.bench]\nsha256 = "{digest}"\nrequests_per_minute = 10000000\nconcurrency = 1000\n'
        "tokens_per_minute = 10000000000\n"
    )
    port = free_port()
    environment = {"GATEWAY_CONFIG": str(config), "REDIS_URL": redis, "PORT": str(port), "HOST": "127.0.0.1"}
    command = [sys.executable, "-m", "services.vlm_gateway"]
    url = f"http://127.0.0.1:{port}"
    return stack.enter_context(second_start("ours", command, url, "/readyz", environment, core))


def litellm(stack: ExitStack, folder: Path, mock: str, redis: str | None, core: int) -> Peer:
    name = "litellm" if redis is None else "litellm+cache"
    settings: dict[str, object] = {"telemetry": False, "drop_params": True, "request_timeout": 60, "num_retries": 2}
    if redis is not None:
        port = int(redis.rsplit(":", 1)[1].split("/")[0])
        settings |= {"cache": True, "cache_params": {"type": "redis", "host": "127.0.0.1", "port": port, "ttl": 3600}}
    upstream = {"model": "openai/mock", "api_base": f"{mock}/v1", "api_key": "sk-none"}
    config = {
        "model_list": [{"model_name": "mock", "litellm_params": upstream}],
        "litellm_settings": settings,
        "general_settings": {"master_key": KEY},
    }
    path = folder / f"{name}.yaml"
    path.write_text(json.dumps(config))  # JSON is YAML
    port = free_port()
    command = [str(LITELLM / "bin" / "litellm"), "--config", str(path), "--host", "127.0.0.1", "--port", str(port)]
    environment = {
        "LITELLM_MODE": "PRODUCTION",
        "LITELLM_LOG": "ERROR",
        "LITELLM_TELEMETRY": "False",
        "LITELLM_LOCAL_MODEL_COST_MAP": "True",
    }
    url = f"http://127.0.0.1:{port}"
    return stack.enter_context(
        second_start(name, [*command, "--num_workers", "1"], url, "/health/liveliness", environment, core)
    )


def install_litellm() -> None:
    """Once, in an environment of its own: its requirements contradict ours."""
    if (LITELLM / "bin" / "litellm").exists():
        return
    uv = shutil.which("uv", path=f"{ROOT / '.venv' / 'bin'}:{os.environ.get('PATH', '')}")
    if uv is None:
        raise SystemExit("uv is missing; run `make setup`")
    sys.stderr.write(f"installing LiteLLM {LITELLM_VERSION} into {LITELLM.relative_to(ROOT)} (once, a minute or two)\n")
    subprocess.run([uv, "venv", "--quiet", "--python", sys.executable, str(LITELLM)], check=True)
    python = str(LITELLM / "bin" / "python")
    subprocess.run([uv, "pip", "install", "-q", "--python", python, f"litellm[proxy]=={LITELLM_VERSION}"], check=True)


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
