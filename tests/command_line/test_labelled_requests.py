"""`bench --subtask parse --requests`: a real parser in a process of its own, over labelled requests."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from command_line.main import app

RUNNER = CliRunner()
ROWS = [
    {"text": "4th floor, the window with the green flower pot", "floor": 4, "object": "green flower pot"},
    {"text": "4th floor, the window with the green flower pot", "floor": 5, "object": "green flower pot"},
    {"text": "the window with the green flower pot, please", "floor": 5, "object": "green flower pot"},
]


@pytest.fixture
def labelled(tmp_path: Path) -> Path:
    path = tmp_path / "few.jsonl"
    path.write_text("".join(json.dumps(row | {"tags": ["plain"]}) + "\n" for row in ROWS * 3))
    return path


def test_a_real_parser_is_scored_and_its_misses_are_written(labelled: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    run = ["bench", "--subtask", "parse", "--requests", str(labelled), "--out", str(out)]
    done = RUNNER.invoke(app, run)
    assert done.exit_code == 0, done.output
    for said in ("9 requests", "silently wrong", "few.jsonl", "plain", "33.3 % [12.1, 64.6]", "ms a request"):
        assert said in done.stdout
    told = json.loads((out / "requests.json").read_text())
    assert [told["all"][outcome]["k"] for outcome in ("right", "asks", "silently_wrong")] == [3, 3, 3]
    missed = [json.loads(line) for line in (out / "misses.jsonl").read_text().splitlines()]
    assert {(miss["outcome"], miss["floor_read"]) for miss in missed} == {("silently_wrong", 4), ("asks", None)}
    assert len(missed) == 6


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--requests", "{labelled}"], "--requests is for --subtask parse"),
        (["--subtask", "floors", "--requests", "{labelled}"], "--requests is for --subtask parse"),
        (["--subtask", "parse", "--tasks", "vld-300", "--requests", "{labelled}"], "takes the place of a task set"),
        (["--subtask", "parse", "--requests", "no/such.jsonl"], "No such file"),
    ],
)
def test_wrong_input_is_told(arguments: list[str], said: str, labelled: Path) -> None:
    done = RUNNER.invoke(app, ["bench", *(a.format(labelled=labelled) for a in arguments)])
    assert done.exit_code == 2
    assert said in done.stderr
