"""The servers of the gateway's benchmarks, each on one core: the gateway, LiteLLM's proxy, a mock of a model server."""

import hashlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import NamedTuple
from urllib.request import Request, urlopen

from tests.load.processes import free_port

ROOT = Path(__file__).parent.parent.parent
LITELLM = ROOT / ".cache" / "litellm"
LITELLM_VERSION = "1.106.2"
KEY = "sk-bench"


class Peer(NamedTuple):
    """One server under load; without a process it is the mock itself. `roots` are the processes whose CPU counts."""

    name: str
    url: str
    roots: tuple[int, ...] = ()
    start_s: float | None = None
    idle_mb: float | None = None


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


@contextmanager
def process(
    name: str,
    command: list[str],
    url: str,
    ready: str,
    environment: dict[str, str],
    cores: int | str,
    within_s: float = 180.0,
    root: Path = ROOT,
) -> Iterator[Peer]:
    """A server started in the folder `root`, pinned to `cores`, once it answers at `ready`; ended on leaving."""
    with tempfile.TemporaryFile() as log:
        started = time.perf_counter()
        child = subprocess.Popen(
            ["taskset", "-c", str(cores), *command], env=os.environ | environment, stdout=log, stderr=log, cwd=root
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
    name: str,
    command: list[str],
    url: str,
    ready: str,
    environment: dict[str, str],
    cores: int | str,
    root: Path = ROOT,
) -> Iterator[Peer]:
    """As every start is but the first after an installation, in which Python compiles what it reads."""
    environment = {**environment, "PYTHONDONTWRITEBYTECODE": ""}
    with process(name, command, url, ready, environment, cores, root=root):
        pass
    with process(name, command, url, ready, environment, cores, root=root) as peer:
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


def ours(
    stack: ExitStack,
    folder: Path,
    mock: str,
    redis: str,
    cores: int | str,
    *,
    root: Path = ROOT,
    name: str = "ours",
    workers: int = 1,
) -> Peer:
    """The gateway of the working tree `root`, with everything on. `mock` answers whole, `mock-stream` in streams."""
    config = folder / f"{name}.toml"
    digest = hashlib.sha256(KEY.encode()).hexdigest()
    models = "".join(
        f'[models.{alias}]\nbackend = "chat"\nbase_url = "{mock}{path}/v1"\nmodel = "maker/mock-1"\npreset = "gpt-4o"\n'
        "concurrency = 64\nusd_per_million_prompt = 1.0\nusd_per_million_completion = 2.0\n\n"
        for alias, path in (("mock", ""), ("mock-stream", "/stream"))
    )
    config.write_text(
        f'{models}[keys.bench]\nsha256 = "{digest}"\nrequests_per_minute = 10000000\nconcurrency = 1000\n'
        "tokens_per_minute = 10000000000\n"
    )
    port = free_port()
    environment = {"GATEWAY_CONFIG": str(config), "REDIS_URL": redis, "PORT": str(port), "HOST": "127.0.0.1"}
    if workers > 1:
        environment["WORKERS"] = str(workers)
    command = [str(root / ".venv" / "bin" / "python"), "-m", "services.vlm_gateway"]
    url = f"http://127.0.0.1:{port}"
    return stack.enter_context(second_start(name, command, url, "/readyz", environment, cores, root))


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
