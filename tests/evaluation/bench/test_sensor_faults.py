"""Faults that a run's flights meet."""

import pytest
from pydantic import ValidationError

from contracts.orchestrator import MissionSettings
from contracts.sensor_profiles import SensorFault
from evaluation.bench.sensor_faults import SensorFaults
from evaluation.bench.task_settings import settings_of_task
from tests.evaluation.evaluation_kit import a_task

TASKS = [f"t-{number}" for number in range(200)]


def test_each_kind_meets_as_many_flights_as_the_rate_says() -> None:
    drawn = [fault.kind for task in TASKS for fault in SensorFaults(rate=0.5).of(task)]
    assert all(70 < drawn.count(kind) < 130 for kind in ("frozen", "no_depth", "pose_jump"))


def test_the_same_seed_gives_the_same_faults_and_a_higher_rate_adds_to_them() -> None:
    few, many = SensorFaults(rate=0.2, seed=7), SensorFaults(rate=0.9, seed=7)
    assert [few.of(task) for task in TASKS] == [SensorFaults(rate=0.2, seed=7).of(task) for task in TASKS]
    assert all(set(few.of(task)) <= set(many.of(task)) for task in TASKS)
    assert [SensorFaults(rate=0.2, seed=8).of(task) for task in TASKS] != [few.of(task) for task in TASKS]


def test_a_flight_has_the_faults_of_its_task_beside_those_of_the_run() -> None:
    own, task, drawn = SensorFault(kind="frozen"), a_task("t-01"), SensorFaults(rate=1.0)
    run = MissionSettings(faults=(own,))
    assert settings_of_task(run, "oracle", task, drawn).faults == (own, *drawn.of(task.id))
    assert settings_of_task(run, "oracle", task).faults == (own,)


@pytest.mark.parametrize("rate", [0.0, 1.1, -0.5])
def test_a_rate_is_a_chance(rate: float) -> None:
    with pytest.raises(ValidationError):
        SensorFaults(rate=rate)
