"""Sensor profiles: those that ship, files that are none, and who chooses."""

from pathlib import Path

import pytest
from pydantic import ValidationError

from contracts.orchestrator import MissionSettings
from contracts.scene import Scene
from contracts.sensor_profiles import (
    BadSensors,
    IdealDepth,
    PictureSensor,
    PoseSensor,
    SensorFault,
    load_sensors,
    sensor_names,
    shipped_sensors,
)
from contracts.sim import EpisodeQuestion
from mission.placement import trial_question
from tests.services.sim.conftest import make_yard

HEAD = 'name = "mine"\nversion = 1\nsources = ["me"]\n'
STEREO = '[depth]\nprinciple = "stereo"\nmin_m = 0.5\nmax_m = 9\nbaseline_m = 0.1\nfocal_px = 600\n'
BAD = {
    "name = 5": r"is not a sensor profile: ",
    'name = "mine"\nversion = 1\nsources = []': r"is not a sensor profile: sources",
    HEAD + '[depth]\nprinciple = "sonar"': r"is not a sensor profile: depth",
    HEAD + STEREO.replace("max_m = 9", "max_m = 0.4") + "disparity_noise_px = 0.1\ndisparity_step_px = 0.1": (
        r"depth.min_m must lie below depth.max_m, not 0.5 and 0.4"
    ),
    HEAD + "[picture]\nblur = 1": r"is not a sensor profile: picture.blur",
    HEAD + "[pose": r"is not TOML",
}


def test_those_that_ship_have_names_versions_and_sources() -> None:
    assert sensor_names() == ("d435", "d455", "perfect", "tof-10m")
    for name in sensor_names():
        profile = shipped_sensors(name)
        assert profile.name == name
        assert profile.label == f"{name}:{profile.version}"
        assert all(profile.sources)


def test_the_perfect_ones_change_nothing() -> None:
    perfect = shipped_sensors("perfect")
    assert (perfect.depth, perfect.picture, perfect.pose) == (IdealDepth(), PictureSensor(), PoseSensor())
    assert perfect.picture.ideal


@pytest.mark.parametrize("text", BAD, ids=range(len(BAD)))
def test_a_file_that_is_no_profile_is_refused_with_what_is_wrong(tmp_path: Path, text: str) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(text)
    with pytest.raises(BadSensors, match=BAD[text]):
        load_sensors(str(path))


def test_a_name_that_is_neither_a_profile_nor_a_file_is_refused_with_those_there_are() -> None:
    with pytest.raises(BadSensors, match=r"neither a file nor one of the shipped sensor profiles: d435, d455, perfect"):
        load_sensors("d405")


def test_the_question_chooses_before_the_scene_and_the_scene_before_nobody() -> None:
    yard = make_yard()
    assert EpisodeQuestion(scene=yard).sensors_flown.name == "perfect"
    stereo = Scene.model_validate(yard.model_dump() | {"sensors": "d455"})
    assert EpisodeQuestion(scene=stereo).sensors_flown.name == "d455"
    asked = EpisodeQuestion.model_validate({"scene": stereo.model_dump(), "sensors": "tof-10m"})
    assert asked.sensors_flown.label == "tof-10m:1"
    settings = MissionSettings.model_validate({"sensors": "d435", "seed": 7, "faults": [{"kind": "frozen"}]})
    question = trial_question(stereo, settings)
    assert (question.sensors_flown.name, question.seed, question.faults) == ("d435", 7, (SensorFault(kind="frozen"),))


def test_a_scene_that_names_no_profile_is_written_as_it_always_was() -> None:
    assert "sensors" not in make_yard().model_dump_json()


def test_a_scene_that_names_a_profile_that_there_is_not_is_refused() -> None:
    with pytest.raises(ValidationError, match="there is no sensor profile 'd405'; there are d435, d455, perfect"):
        Scene.model_validate(make_yard().model_dump() | {"sensors": "d405"})


def test_a_fault_holds_for_as_many_looks_as_were_asked_for() -> None:
    twice = SensorFault(kind="no_depth", first_look=3, looks=2)
    assert [twice.at(look) for look in range(1, 7)] == [False, False, True, True, False, False]
    assert SensorFault(kind="frozen", first_look=2).at(1000)
