"""The settings of a run, read from its folder."""

import json

import pytest
from pydantic import ValidationError

from evaluation.bench.run_settings import RunSettings
from tests.evaluation.evaluation_kit import a_task, run_settings

CONSTANTS = {"direction": "clockwise", "slices": 30, "delta_m": 6.0, "d_max_m": 25.0, "max_over": 2}
EXPLORE = {"l_max_m": 8.0, "min_move_m": 1.0, "inspect_range_m": 11.5}


def of_version_0_1(policy: str, choice: str) -> str:
    document = json.loads(run_settings([a_task("t")]).model_dump_json())
    document["mission"] |= {
        "viewpoint": CONSTANTS | {"policy": policy},
        "choice": choice,
        "explore": EXPLORE,
        "safe_distances": {"clearance_m": 1.2},
        "min_move_m": 1.5,
    }
    return json.dumps(document)


def test_a_run_of_version_0_1_reads_as_the_policy_it_flew_with_the_settings_that_this_has() -> None:
    paper = RunSettings.read(of_version_0_1("paper", "centre")).mission.viewpoint
    assert paper.policy == "paper"
    assert paper.constants == CONSTANTS | {
        "choice": "centre",
        "min_move_m": 1.5,
        "safe_distances": {"clearance_m": 1.2},
    }
    contour = RunSettings.read(of_version_0_1("contour", "model")).mission.viewpoint
    assert (contour.policy, contour.constants) == ("contour", EXPLORE)


def test_a_run_of_today_reads_as_it_was_written_whatever_packages_are_installed() -> None:
    written = run_settings([a_task("t")], viewpoint={"policy": "of-somebody-else", "speed": 3})
    assert RunSettings.read(written.model_dump_json()) == written


def test_settings_that_are_none_are_refused() -> None:
    with pytest.raises(ValidationError):
        RunSettings.read('{"tasks": "x"}')
