"""The command line asks what a request leaves open: on a terminal, from answers given beforehand, or not at all."""

import json
import os
import pty
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import httpx
import pytest

from contracts.llm_parser import ParseAnswer, ParseQuestion
from service_kit.addresses import Addresses
from service_kit.app import create_app
from tests.conftest import Serve
from tests.mission.box_world import SceneParser

VAGUE = "the window with the brown teddy bear"
"""Of the sample villa-teddy-bear, where it is on floor 2."""
ASKED = "Which floor is the window on?"


@pytest.fixture
def attentive(at: Addresses, serve: Serve) -> Addresses:
    """The house with a parser that reads only "floor N" and "the ...", and hears what was answered."""
    app = create_app("llm_parser", max_body_bytes=100_000)

    @app.post("/v1/parse")
    async def parse(question: ParseQuestion) -> ParseAnswer:
        return await SceneParser().parse(question)

    return replace(at, llm_parser=serve(app))


def command(at: Addresses, runs: Path, *more: str) -> list[str]:
    urls = ",".join(f"{name}={url}" for name, url in vars(at).items())
    flown = ("--sample", "villa-teddy-bear", "--backend", "oracle", "--image-size", "200")
    line = ["deliver", VAGUE, *flown, *more, "--services", urls, "--out", str(runs)]
    return [sys.executable, "-m", "command_line", *line]


def test_with_json_nobody_is_asked_and_the_end_says_the_question(attentive: Addresses, runs: Path) -> None:
    done = subprocess.run(command(attentive, runs, "--json"), capture_output=True, text=True, timeout=60, check=False)
    told = json.loads(done.stdout)
    assert (done.returncode, told["outcome"]) == (1, "request_incomplete")
    assert ASKED in told["message"]


def test_an_answer_given_beforehand_goes_on_with_the_delivery(attentive: Addresses, runs: Path) -> None:
    line = command(attentive, runs, "--json", "--answer", "floor 2")
    done = subprocess.run(line, capture_output=True, text=True, timeout=120, check=False)
    assert json.loads(done.stdout)["outcome"] == "delivered", done.stderr
    assert done.returncode == 0


class Typed(NamedTuple):
    """What was shown, and how the command ended."""

    shown: str
    code: int


def on_a_terminal(line: list[str], act: Callable[[subprocess.Popen[bytes], int], object]) -> Typed:
    """Runs the command on a terminal of its own; once it asks, `act` does something to the process or types."""
    ours, theirs = pty.openpty()
    environment = os.environ | {"COLUMNS": "120", "LINES": "50", "TERM": "xterm"}
    shown, acted, give_up = b"", False, time.monotonic() + 90
    with subprocess.Popen(line, stdin=theirs, stdout=theirs, stderr=theirs, env=environment) as process:
        os.close(theirs)
        try:
            while time.monotonic() < give_up:
                if not select.select([ours], [], [], 1.0)[0]:
                    continue
                try:
                    shown += os.read(ours, 65536)
                except OSError:  # nobody holds the other end: the command has ended
                    break
                if not acted and b"Your answer:" in shown:
                    act(process, ours)
                    acted = True
            else:
                process.kill()
        finally:
            os.close(ours)
    return Typed(shown.decode(errors="replace"), process.returncode)


def typing(text: bytes) -> Callable[[subprocess.Popen[bytes], int], object]:
    return lambda _, terminal: os.write(terminal, text)


def test_on_a_terminal_the_question_is_asked_and_the_typed_answer_goes_on(attentive: Addresses, runs: Path) -> None:
    typed = on_a_terminal(command(attentive, runs), typing(b"it is floor 2\n"))
    assert typed.code == 0, typed.shown[-2000:]
    assert ASKED in typed.shown
    assert "DELIVERED" in typed.shown


def test_a_terminal_whose_input_ends_ends_the_delivery_as_incomplete(attentive: Addresses, runs: Path) -> None:
    typed = on_a_terminal(command(attentive, runs), typing(b"\x04"))
    assert typed.code == 1
    assert "REQUEST INCOMPLETE" in typed.shown


def test_an_interrupt_at_the_question_leaves_a_complete_record(attentive: Addresses, runs: Path) -> None:
    typed = on_a_terminal(command(attentive, runs), lambda process, _: process.send_signal(signal.SIGINT))
    assert typed.code == 130, typed.shown[-2000:]
    result = json.loads(next(runs.glob("*/result.json")).read_text())
    assert result["outcome"] == "cancelled"


def wait_for(client: httpx.Client, name: str, status: str) -> dict[str, Any]:
    """The delivery once it has that status."""
    give_up = time.monotonic() + 60
    while True:
        delivery: dict[str, Any] = client.get(f"/v1/deliveries/{name}").json()
        if delivery["status"] == status:
            return delivery
        assert time.monotonic() < give_up, delivery
        time.sleep(0.05)


def test_over_rest_the_real_parser_reads_the_request_again_with_the_answer(orchestrator_url: str) -> None:
    with httpx.Client(base_url=orchestrator_url, timeout=30) as client:
        order = {"request": VAGUE, "sample": "villa-teddy-bear", "backend": "oracle"}
        name = client.post("/v1/deliveries", json=order).json()["id"]
        assert "floor" in wait_for(client, name, "needs_answer")["question"]["text"].lower()
        assert client.post(f"/v1/deliveries/{name}/answer", json={"text": "the second floor"}).status_code == 200
        kinds: list[str] = []
        with client.stream("GET", f"/v1/deliveries/{name}/events") as stream:
            for line in stream.iter_lines():
                if line.startswith("data: "):
                    kinds.append(json.loads(line.removeprefix("data: "))["kind"])
                if kinds.count("parsed") == 2:
                    break
        client.delete(f"/v1/deliveries/{name}")
        assert kinds[-1] == "parsed"
        assert kinds.index("question") < kinds.index("answer") < len(kinds) - 1
