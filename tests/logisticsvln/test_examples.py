"""The scripts of docs/examples run as they stand."""

import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"
SAID = {
    "first_flight.py": "delivered: in front of the right window",
    "own_policy.py": "farthest-way: delivered",
    "own_model.py": "delivered: in front of the right window",
    "random_agent.py": "'outcome': '",
    "scripted_agent.py": "{'task': 'green-flower-pot', 'outcome': '",
}
QUICK = {"first_flight.py"}


@pytest.mark.parametrize(
    "script", [pytest.param(name, marks=() if name in QUICK else pytest.mark.slow) for name in SAID]
)
def test_an_example_runs_as_it_stands(tmp_path: Path, script: str) -> None:
    ran = subprocess.run([sys.executable, EXAMPLES / script], cwd=tmp_path, capture_output=True, text=True, timeout=170)
    assert ran.returncode == 0, ran.stderr
    assert SAID[script] in ran.stdout
    assert "Traceback" not in ran.stderr


def test_every_example_is_run() -> None:
    assert set(SAID) == {path.name for path in EXAMPLES.glob("*.py")}
