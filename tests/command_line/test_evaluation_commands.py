"""The commands of the task set and the evaluation, asked nonsense and asked for help."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from command_line.main import app
from evaluation.task_set.task_files import lines_of
from tests.evaluation.evaluation_kit import a_task

runner = CliRunner()


def write(folder: Path) -> Path:
    path = folder / "tasks.jsonl"
    path.write_bytes(lines_of([a_task("t-1"), a_task("t-2", facade=1)]))
    return path


@pytest.mark.parametrize("command", ["deliver", "serve", "doctor", "samples", "bench", "tasks"])
def test_all_commands_are_under_one_name(command: str) -> None:
    assert runner.invoke(app, [command, "--help"]).exit_code == 0


@pytest.mark.parametrize("command", [("bench", "--limit", "2"), ("bench", "--subtask", "floors"), ("evaluate",)])
def test_a_model_that_there_is_not_is_refused_before_the_first_question(
    command: tuple[str, ...], tmp_path: Path
) -> None:
    out = tmp_path / "run"
    result = runner.invoke(app, [*command, "--backend", "Qwen/Qwen2.5-VL-7B-Instruct", "--out", str(out)])
    assert result.exit_code == 2, result.output
    assert "no model 'Qwen/Qwen2.5-VL-7B-Instruct'; there is embedded" in result.stderr
    assert not out.exists()


@pytest.mark.parametrize(
    ("parser", "said"), [("qwen", "no model 'qwen'; there is embedded"), ("embedded", "reads no requests")]
)
def test_a_parser_that_there_is_not_is_refused_before_the_first_flight(parser: str, said: str, tmp_path: Path) -> None:
    result = runner.invoke(app, ["bench", "--limit", "2", "--parser", parser, "--out", str(tmp_path / "run")])
    assert result.exit_code == 2, result.output
    assert said in result.stderr
    assert "a parser is 'reader', or a chat model of the gateway's configuration" in result.stderr
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (("--tasks", "nowhere"), "no task set"),
        (("--tasks", "nowhere", "--seed", "1", "--count", "2"), "either --tasks or --seed"),
        (("--seed", "1"), "both --seed and --count"),
        (("--seed", "1", "--count", "2001"), "1 to 2000"),
        (("--miss-rate", "0.1"), "only the oracle"),
        (("--miss-rate", "1.5", "--backend", "oracle"), "miss-rate"),
        (("--viewpoint", "best"), "viewpoint"),
        (("--backend", "no such thing"), "backend"),
        (("--recording", "x.sqlite", "--cache", "off"), "leave one out"),
    ],
)
def test_a_bench_that_makes_no_sense_is_refused_before_anything_starts(
    tmp_path: Path, arguments: tuple[str, ...], why: str
) -> None:
    if "--tasks" not in arguments and "--seed" not in arguments:
        arguments = (*arguments, "--tasks", str(write(tmp_path)))
    asked = runner.invoke(app, ["bench", *arguments, "--out", str(tmp_path / "run")])
    assert (asked.exit_code, asked.stdout) == (2, "")
    assert why in " ".join(asked.stderr.split())
    assert "Traceback" not in asked.stderr
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (("show", "t-9"), "no task"),
        (("stats", "nowhere"), "no task set"),
        (("generate", "--seed", "1", "--count", "0"), "count"),
        (("generate", "--seed", "1", "--count", "1", "--out", "."), "is there already"),
    ],
)
def test_tasks_that_are_not_there_are_named(tmp_path: Path, arguments: tuple[str, ...], why: str) -> None:
    if arguments[0] == "show":
        arguments = (*arguments, "--tasks", str(write(tmp_path)))
    asked = runner.invoke(app, ["tasks", *arguments])
    assert asked.exit_code == 2
    assert why in " ".join(asked.stderr.split())


def test_a_set_is_counted_and_drawn(tmp_path: Path) -> None:
    asked = runner.invoke(app, ["tasks", "stats", str(write(tmp_path)), "--out", str(tmp_path / "page"), "--json"])
    assert asked.exit_code == 0, asked.stderr
    assert '"difficulty":{"easy":2,"moderate":0,"hard":0}' in asked.stdout
    assert (tmp_path / "page" / "tasks.png").read_bytes().startswith(b"\x89PNG")
    assert "| containers | 2 | 100.0 % |" in (tmp_path / "page" / "tasks.md").read_text(encoding="utf-8")
