"""What tests of several parts share: real servers on free ports, stopped at the end."""

import os
import shutil
import socket
import subprocess
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Protocol

import certifi
import pytest
import uvicorn
from starlette.types import ASGIApp

from service_kit.http_limits import ConnectionLimits
from service_kit.run import server_config
from tests.ending import WITH_THE_TESTS
from tests.postgres import Postgres


class Serve(Protocol):
    """Runs an app on real HTTP, within these bounds of connections, and returns its URL."""

    def __call__(self, app: ASGIApp, limits: ConnectionLimits | None = None) -> str: ...


LONGEST_FIRST = ("evaluation/bench", "system", "services/mavlink_vehicle", "orchestrator", "extending")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Files whose tests take seconds each start first: begun last they would keep one process busy, the others idle."""

    def place(item: pytest.Item) -> int:
        folder = item.path.relative_to(Path(__file__).parent).as_posix()
        return next((at for at, long in enumerate(LONGEST_FIRST) if folder.startswith(f"{long}/")), len(LONGEST_FIRST))

    items.sort(key=place)


@pytest.fixture(scope="session", autouse=True)
def one_authority(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Everything here is asked over plain HTTP, yet httpx reads the certificates of all public authorities for every
    client, which takes longer than most requests: one is enough."""
    end = "-----END CERTIFICATE-----\n"
    first = tmp_path_factory.mktemp("authority") / "first.pem"
    first.write_text(certifi.contents().partition(end)[0] + end, encoding="ascii")
    before = os.environ.get("SSL_CERT_FILE")
    os.environ["SSL_CERT_FILE"] = str(first)
    yield
    if before is None:
        del os.environ["SSL_CERT_FILE"]
    else:
        os.environ["SSL_CERT_FILE"] = before


def free_port() -> int:
    """A TCP port of the loopback that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@pytest.fixture(scope="module")
def serve() -> Iterator[Serve]:
    """`serve(app)` runs an ASGI app on real HTTP in a thread and returns its URL; all stop after the module."""
    running: list[tuple[uvicorn.Server, threading.Thread]] = []

    def start(app: ASGIApp, limits: ConnectionLimits | None = None) -> str:
        port = free_port()
        server = uvicorn.Server(server_config(app, "127.0.0.1", port, 2, limits))
        thread = threading.Thread(target=server.run, daemon=True)
        thread.start()
        running.append((server, thread))
        give_up = time.monotonic() + 20
        while not server.started:
            if not thread.is_alive() or time.monotonic() > give_up:
                raise RuntimeError("the server under test did not start")
            time.sleep(0.005)
        return f"http://127.0.0.1:{port}"

    yield start
    for server, _ in running:
        server.should_exit = True
    for _, thread in running:
        thread.join(10)


class RedisProcess:
    """A redis-server of the test's own; `process` may be stopped or killed."""

    def __init__(self, folder: Path) -> None:
        self.port = free_port()
        self.url = f"redis://127.0.0.1:{self.port}/0"
        self._folder = folder
        self.process = self._spawn()

    def _spawn(self) -> subprocess.Popen[bytes]:
        program = shutil.which("redis-server")
        if program is None:
            raise RuntimeError("redis-server is not installed; `make test` installs Debian's package redis-server")
        command = [
            *WITH_THE_TESTS,
            program,
            "--port",
            str(self.port),
            "--bind",
            "127.0.0.1",
            "--save",
            "",
            "--appendonly",
            "no",
        ]
        process = subprocess.Popen([*command, "--dir", str(self._folder)], stdout=subprocess.DEVNULL)
        give_up = time.monotonic() + 20
        while time.monotonic() < give_up:
            with socket.socket() as probe:
                if probe.connect_ex(("127.0.0.1", self.port)) == 0:
                    return process
            time.sleep(0.01)
        process.kill()
        process.wait()
        raise RuntimeError("redis-server did not start")

    def restart(self) -> None:
        """Again on the same port, empty."""
        self.stop()
        self.process = self._spawn()

    def stop(self) -> None:
        self.process.kill()
        self.process.wait()


@pytest.fixture
def redis_server(tmp_path: Path) -> Iterator[RedisProcess]:
    """A real redis-server on a free port."""
    server = RedisProcess(tmp_path)
    yield server
    server.stop()


@pytest.fixture(scope="session")
def postgres() -> Iterator[Postgres]:
    """A real PostgreSQL, one for the session."""
    server = Postgres(free_port())
    yield server
    server.close()
