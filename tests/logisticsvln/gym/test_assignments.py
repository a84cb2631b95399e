"""What an episode may be about, and what is told of anything else."""

from pathlib import Path
from typing import Any

import pytest

from logisticsvln import BadScene, sample
from logisticsvln.gym.assignments import assignments_of, chosen_by
from logisticsvln.gym.environment import LogisticsVlnEnv

AMONG = assignments_of([sample("street-kite")])


def test_a_scene_may_be_the_file_of_one(tmp_path: Path) -> None:
    path = tmp_path / "mine.json"
    path.write_text(AMONG[0].scene.model_dump_json())
    for given in (path, str(path), AMONG[0].scene):
        chosen = chosen_by({"scene": given, "request": "3. Stock, der blaue Drachen – bitte läuten"}, AMONG)
        assert chosen is not None
        assert chosen.scene == AMONG[0].scene


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        ("street-kite", "give a dictionary"),
        ({"scene": {"name": "a"}, "request": "x"}, "a Scene or the file of one, not dict"),
        ({"task": 5}, "a Task or a Sample, not int"),
        ({"task": "streetkite"}, r"no task 'streetkite' \(did you mean 'street-kite'\?\); there is street-kite$"),
        ({"task": "street-kite", "request": 5}, "a text of at most 4000"),
        ({"task": "street-kite", "request": "x" * 4001}, "a text of at most 4000"),
        ({"task": "street-kite", "request": "三楼 🪁"}, "Latin ones alone: '三楼🪁'"),
    ],
)
def test_options_that_are_none_are_told(options: Any, problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        chosen_by(options, AMONG)


def test_of_many_tasks_the_first_are_listed() -> None:
    among = [AMONG[0]._replace(name=f"t-{number}") for number in range(300)]
    with pytest.raises(ValueError, match=r"there are t-0, t-1, .*, t-9 and 290 more, up to t-299$"):
        chosen_by({"task": "x"}, among)


def test_a_file_that_is_no_scene_and_tasks_that_are_none_are_told() -> None:
    with pytest.raises(BadScene, match=r"nowhere\.json: No such file"):
        chosen_by({"scene": "nowhere.json", "request": "x"}, AMONG)
    with pytest.raises(
        ValueError, match=r"no task set 'sample' \(did you mean 'samples'\?\): name samples, one of vld"
    ):
        assignments_of("sample")
    with pytest.raises(ValueError, match="not str"):
        assignments_of(["street-kite"])  # type: ignore[list-item]


@pytest.mark.parametrize("size", [0, -5, 100_000])
def test_pictures_of_no_size_are_refused_before_a_simulator_is_started(size: int) -> None:
    with pytest.raises(ValueError, match="image_size"):
        LogisticsVlnEnv(image_size=size)
