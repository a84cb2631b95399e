"""SIGTERM: what is under way gets its answer, within the time that is set; what would never end does not hold it up."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import httpx
import pytest

from tests.conftest import free_port

SERVICE = """
import asyncio, sys
from collections.abc import AsyncIterator
from pathlib import Path
from fastapi import FastAPI
from sse_starlette import EventSourceResponse
from service_kit.app import create_app
from service_kit.run import main
from service_kit.settings import ServiceSettings

def bootstrap(settings: ServiceSettings) -> FastAPI:
    app = create_app("slow", max_body_bytes=1000)

    @app.get("/slow")
    async def slow() -> str:
        Path(sys.argv[1]).touch()
        await asyncio.sleep(1.5)
        return "done"

    @app.get("/events")
    async def events() -> EventSourceResponse:
        async def stream() -> AsyncIterator[str]:
            yield "first"
            await asyncio.sleep(600)
        return EventSourceResponse(stream())

    return app

main("slow", ServiceSettings, bootstrap)
"""


@contextmanager
def service(folder: Path, drain_s: int) -> Iterator[tuple[subprocess.Popen[bytes], str, Path]]:
    port, begun = free_port(), folder / "begun"
    environment = os.environ | {"PORT": str(port), "DRAIN_TIMEOUT_S": str(drain_s)}
    with subprocess.Popen([sys.executable, "-c", SERVICE, str(begun)], env=environment) as process:
        url = f"http://127.0.0.1:{port}"
        try:
            until(lambda: answers(url))
            yield process, url, begun
        finally:
            process.kill()


def answers(url: str) -> bool:
    try:
        return httpx.get(f"{url}/healthz").status_code == 200
    except httpx.ConnectError:
        return False


def until(condition: object) -> None:
    assert callable(condition)
    give_up = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < give_up
        time.sleep(0.05)


@pytest.mark.parametrize(("drain_s", "answered"), [(20, True), (0, False)])
def test_an_answer_under_way_is_finished_within_the_time_that_is_set(
    tmp_path: Path, drain_s: int, answered: bool
) -> None:
    with service(tmp_path, drain_s) as (process, url, begun), ThreadPoolExecutor(1) as aside:
        asked = aside.submit(httpx.get, f"{url}/slow", timeout=60)
        until(begun.exists)
        process.send_signal(signal.SIGTERM)
        answer = asked.result(60)
        if answered:
            assert answer.json() == "done"
        else:
            assert (answer.status_code, answer.json()["error"]["code"]) == (503, "stopping")
        assert process.wait(10) in (0, -signal.SIGTERM)


def test_a_stream_of_events_does_not_hold_up_the_end(tmp_path: Path) -> None:
    with service(tmp_path, 30) as (process, url, _), httpx.stream("GET", f"{url}/events") as events:
        lines = events.iter_lines()
        assert next(lines) == "data: first"
        started = time.monotonic()
        process.send_signal(signal.SIGTERM)
        process.wait(20)
        assert time.monotonic() - started < 15
