"""A search policy from a package outside the tree, in the command's own processes."""

import json
import os
import subprocess
import sys
from pathlib import Path

from contracts.events import SearchEvent
from contracts.orchestrator import DeliveryQuestion
from mission.record import read_events, read_state
from tests.extending.conftest import install


def deliver(site: Path, out: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "command_line", "deliver", "--json", "--out", str(out), *arguments],
        env=os.environ | {"PYTHONPATH": str(site)},
        capture_output=True,
        text=True,
        timeout=120,
    )


SMALL = ("--sample", "green-flower-pot", "--backend", "oracle", "--image-size", "400", "--max-steps", "4")


def test_an_installed_policy_flies_by_its_name_and_is_recorded_with_its_settings(extras: Path, tmp_path: Path) -> None:
    done = deliver(extras, tmp_path, *SMALL, "--viewpoint", "widest-way")
    told = json.loads(done.stdout)
    assert told["search_policy"] == "widest-way"
    folder = Path(told["folder"])
    asked = DeliveryQuestion.model_validate_json((folder / "question.json").read_text(encoding="utf-8"))
    assert asked.settings.viewpoint.constants == {"direction": "clockwise", "least_m": 1.0, "patience": 12}
    state = read_state(folder)
    assert state is not None
    assert state.memory == {"inspected_share": None, "stuck": 0}
    flown = (folder / "events.jsonl").read_text(encoding="utf-8")
    assert "along the widest way" in flown
    told_by_policy = [event.data for event in read_events(folder) if isinstance(event, SearchEvent)]
    assert told_by_policy
    assert {data.policy for data in told_by_policy} == {"widest-way"}


def test_a_setting_that_the_policy_has_not_got_is_refused_by_the_policys_own_list(extras: Path, tmp_path: Path) -> None:
    done = deliver(extras, tmp_path, *SMALL, "--viewpoint", "widest-way", "--choice", "centre")
    assert done.returncode == 2
    assert "widest-way has no setting choice; paper, random, default have it" in done.stderr
    assert "Traceback" not in done.stderr


def test_a_name_that_is_built_in_is_refused_with_the_package_that_brings_it(tmp_path: Path) -> None:
    package = tmp_path / "package"
    (package / "sly").mkdir(parents=True)
    (package / "sly" / "__init__.py").write_text("")
    (package / "pyproject.toml").write_text(
        '[project]\nname = "sly"\nversion = "1.0"\n'
        '[project.entry-points."logisticsvln.search_policies"]\npaper = "sly:Paper"\n'
    )
    site = tmp_path / "site"
    site.mkdir()
    done = deliver(install(package, site), tmp_path / "out", *SMALL, "--viewpoint", "anything")
    assert done.returncode == 2
    assert "'sly'" in done.stderr
    assert "'paper'" in done.stderr
    assert "Traceback" not in done.stderr
