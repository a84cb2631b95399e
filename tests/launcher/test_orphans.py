"""What a process started does not outlive it, however it ends."""

import os
import signal
import subprocess
import sys
import time

import pytest

SIMULATOR = """
import time
from evaluation.sim_client import own_simulator
with own_simulator():
    print("ready", flush=True)
    time.sleep(600)
"""
SERVICES = """
import asyncio, pathlib, sys, time
from launcher.processes import Processes, free_ports
from service_kit.settings import process_environment
group = Processes(free_ports(["depth_assist"]), pathlib.Path(sys.argv[1]), environment=process_environment())
group.start()
asyncio.run(group.ready())
print("ready", flush=True)
time.sleep(600)
"""


def children(pid: int) -> list[int]:
    with open(f"/proc/{pid}/task/{pid}/children", encoding="ascii") as file:
        return [int(child) for child in file.read().split()]


def alive(pid: int) -> bool:
    try:
        with open(f"/proc/{pid}/stat", encoding="utf-8") as file:
            return file.read().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


@pytest.mark.parametrize("program", [SIMULATOR, SERVICES], ids=["simulator", "services"])
def test_a_killed_process_takes_what_it_started_along(
    program: str, tmp_path: os.PathLike[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PARENT_PID", "1")  # what it was given itself is not handed on
    command = [sys.executable, "-c", program, str(tmp_path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as started:
        try:
            assert started.stdout is not None
            assert started.stdout.readline() == "ready\n"
            theirs = children(started.pid)
            assert theirs
        finally:
            started.send_signal(signal.SIGKILL)
    until = time.monotonic() + 60
    while any(map(alive, theirs)):
        assert time.monotonic() < until, "still there a minute after"
        time.sleep(0.1)
