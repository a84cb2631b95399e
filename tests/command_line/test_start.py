"""How the command begins: quickly, with nothing loaded that is not needed, and ended by Ctrl-C without a traceback."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from typer.testing import CliRunner

from command_line.main import COMMANDS, app

HEAVY = ("numpy", "aiohttp", "cv2", "pybullet", "moderngl", "fastapi", "pyarrow", "contracts", "evaluation")
OUR_OWN = {"command_line", "command_line.__main__", "command_line.main"}
LOADED = """
import sys
from command_line.__main__ import main
try:
    main()
except SystemExit:
    print(*sorted(sys.modules))
"""
BEGUN = """
from command_line.__main__ import main
print("begun", flush=True)
main()
"""


@pytest.mark.parametrize("arguments", [["--help"], [], ["nonsense"]])
def test_listing_the_commands_loads_none_of_them(arguments: list[str]) -> None:
    ran = subprocess.run([sys.executable, "-c", LOADED, *arguments], capture_output=True, text=True, check=True)
    loaded = set(ran.stdout.splitlines()[-1].split())
    assert "typer" in loaded
    assert not loaded & set(HEAVY)
    assert {name for name in loaded if name.startswith("command_line")} <= OUR_OWN


def test_a_command_loads_no_other() -> None:
    ran = subprocess.run([sys.executable, "-c", LOADED, "samples"], capture_output=True, text=True, check=True)
    loaded = ran.stdout.splitlines()[-1].split()
    assert "command_line.samples" in loaded
    assert not {"command_line.bench", "command_line.deliver", "evaluation"} & set(loaded)


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_that_is_listed_is_there(name: str) -> None:
    helped = CliRunner().invoke(app, [name, "--help"])
    assert helped.exit_code == 0
    assert "--install-completion" not in helped.stdout
    assert f"logisticsvln {name}" in helped.stdout or f"{name} [OPTIONS]" in helped.stdout


@pytest.mark.parametrize("after_s", [0.05, 0.2, 0.4])
def test_an_interrupt_before_the_first_question_ends_the_command_without_a_traceback(
    tmp_path: Path, after_s: float
) -> None:
    command = [sys.executable, "-c", BEGUN, "bench", "--out", str(tmp_path / "run")]
    run = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True)
    assert run.stdout is not None
    assert run.stdout.readline() == "begun\n"
    time.sleep(after_s)
    os.killpg(run.pid, signal.SIGINT)
    out, err = run.communicate(timeout=60)
    assert run.returncode in (130, -signal.SIGINT)
    assert "Traceback" not in out + err
    assert not (tmp_path / "run").exists()


@pytest.mark.slow
def test_a_set_that_was_made_is_named_and_nothing_else_is_said(tmp_path: Path) -> None:
    out = tmp_path / "sets" / "one.jsonl.zst"
    command = [sys.executable, "-m", "command_line", "tasks", "generate", "--seed", "5", "--count", "1"]
    made = subprocess.run([*command, "--out", str(out)], capture_output=True, text=True, check=True, timeout=300)
    assert made.stdout == f"{out}: 1 task at 1 building\n"
    assert "pybullet" not in made.stderr
