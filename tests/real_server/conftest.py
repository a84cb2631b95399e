"""Real model servers with tiny random models, and the gateway in front of them, all as processes of their own.

`make test-real-server` prepares the servers' environments; each server is a folder under REAL_SERVERS (`.cache`).
"""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import httpx
import pytest

from tests.conftest import free_port

HERE = Path(__file__).parent
STARTS_WITHIN_S = 900.0


class Running(NamedTuple):
    """A server process; `model` is the name it knows its model by."""

    url: str
    model: str
    process: subprocess.Popen[bytes]
    log: Path


def environment_of(name: str) -> Path:
    """The environment's folder of executables. Skips nothing: what was asked for must be there."""
    folder = Path(os.environ.get("REAL_SERVERS", ".cache")).resolve() / name / "bin"
    if not (folder / "python").exists():
        pytest.fail(f"{folder} is not there: run `make test-real-server`, which prepares it")
    return folder


@contextmanager
def process(command: list[str], alive: str, log: Path, **environment: str) -> Iterator[subprocess.Popen[bytes]]:
    """Runs it from the moment its `alive` address answers; stops it in the end."""
    with log.open("wb") as file:
        started = subprocess.Popen(command, stdout=file, stderr=file, env={**os.environ, **environment})
    try:
        give_up = time.monotonic() + STARTS_WITHIN_S
        while not _answers(alive):
            said = log.read_text(errors="replace")[-2000:]
            assert started.poll() is None, f"{command[0]} ended: {said}"
            assert time.monotonic() < give_up, f"{command[0]} does not answer: {said}"
            time.sleep(0.2)
        yield started
    finally:
        if started.poll() is None:
            started.send_signal(signal.SIGCONT)
            started.terminate()
            try:
                started.wait(15)
            except subprocess.TimeoutExpired:
                started.kill()
                started.wait()


def _answers(address: str) -> bool:
    try:
        return httpx.get(address, timeout=2.0).status_code == 200
    except httpx.HTTPError:
        return False


@pytest.fixture(scope="session")
def vision_model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("tiny-qwen2-vl")
    python = str(environment_of("real-server") / "python")
    command = [python, str(HERE / "tiny_vision_model.py"), str(folder)]
    done = subprocess.run(
        command, env={**os.environ, "HF_HUB_OFFLINE": "1"}, capture_output=True, text=True, timeout=600
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return folder


@contextmanager
def transformers_serve(model: Path, log: Path) -> Iterator[Running]:
    port = free_port()
    program = str(environment_of("real-server") / "transformers")
    command = [program, "serve", str(model), "--host", "127.0.0.1", "--port", str(port)]
    command += ["--device", "cpu", "--dtype", "float32"]
    with process(command, f"http://127.0.0.1:{port}/health", log, HF_HUB_OFFLINE="1") as started:
        yield Running(f"http://127.0.0.1:{port}/v1", str(model), started, log)


@pytest.fixture(scope="session")
def real(vision_model: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    """`transformers serve` with the tiny Qwen2-VL."""
    with transformers_serve(vision_model, tmp_path_factory.mktemp("logs") / "transformers.log") as running:
        yield running


Gateway = Callable[..., str]


@pytest.fixture
def gateway(tmp_path: Path) -> Iterator[Gateway]:
    """`gateway(config, **environment)` starts one as a process and returns its address."""
    stopping = []

    def start(config: str, **environment: str) -> str:
        port = free_port()
        path = tmp_path / f"gateway-{port}.toml"
        path.write_text(config)
        settings = {"GATEWAY_CONFIG": str(path), "PORT": str(port), "CACHE_MODE": "off"} | environment
        url = f"http://127.0.0.1:{port}"
        command = [sys.executable, "-m", "services.vlm_gateway"]
        running = process(command, url + "/healthz", tmp_path / f"gateway-{port}.log", **settings)
        running.__enter__()
        stopping.append(running)
        return url

    yield start
    for running in reversed(stopping):
        running.__exit__(None, None, None)
