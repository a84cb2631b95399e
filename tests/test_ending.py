"""That a program started by tests ends with them, over real processes."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

TESTS = """
import subprocess, sys, time
from tests.ending import WITH_THE_TESTS
print(subprocess.Popen([*WITH_THE_TESTS, "sleep", "600"]).pid, flush=True)
time.sleep(600)
"""


def alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def begun(pid: int) -> bool:
    """Has the kernel been asked, and the program taken its place?"""
    return Path(f"/proc/{pid}/comm").read_text() == "sleep\n"


def test_a_program_started_by_tests_that_are_killed_ends_with_them() -> None:
    with subprocess.Popen([sys.executable, "-c", TESTS], stdout=subprocess.PIPE, text=True) as tests:
        assert tests.stdout is not None
        program = int(tests.stdout.readline())
        until = time.monotonic() + 30
        while not begun(program):
            assert time.monotonic() < until, "it has not begun"
            time.sleep(0.02)
        os.kill(tests.pid, signal.SIGKILL)
    until = time.monotonic() + 30
    while alive(program):
        assert time.monotonic() < until, "it is still there"
        time.sleep(0.02)
