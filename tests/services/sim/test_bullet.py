"""PyBullet is imported in one place, where its banner stays unsaid."""

import subprocess
import sys
from pathlib import Path

SIM = Path(__file__).parents[3] / "services" / "sim"


def test_a_program_with_the_simulated_world_in_it_prints_nothing() -> None:
    ran = subprocess.run([sys.executable, "-c", "import services.sim.world"], capture_output=True, text=True)
    assert (ran.returncode, ran.stdout, ran.stderr) == (0, "", "")


def test_no_other_module_of_the_simulator_imports_it() -> None:
    importing = [path for path in SIM.rglob("*.py") if "\n    import pybullet" in path.read_text(encoding="utf-8")]
    others = [path for path in SIM.rglob("*.py") if "\nimport pybullet" in path.read_text(encoding="utf-8")]
    assert ([path.name for path in importing], others) == (["bullet.py"], [])
