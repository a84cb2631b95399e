"""The command line: wrong inputs end with code 2 and one clear line; what it says of itself is true."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from command_line.main import app
from launcher.processes import free_ports
from orchestrator import sample_library

RUNNER = CliRunner()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["deliver"], "either a scene or the name of a sample"),
        (["deliver", "hello", "--sample", "nowhere"], "there is no sample 'nowhere'"),
        (["deliver", "hello", "--scene", "no/such/file.json"], "No such file"),
        (["deliver", "hello", "--scene", "{folder}"], "Is a directory"),
        (["deliver", "hello", "--scene", "{broken}"], "is not a scene"),
        (["deliver", "hello", "--scene", "{binary}"], "is not a text file"),
        (["deliver", "--sample", "green-flower-pot", "--services", "sim=ftp://x"], "--services"),
        (["deliver", "--sample", "green-flower-pot", "--backend", "so so"], "backend"),
        (["deliver", "x" * 5000, "--sample", "green-flower-pot"], "request"),
        (["deliver", "--sample", "green-flower-pot", "--viewpoint", "sideways"], "viewpoint"),
        (
            ["deliver", "--sample", "green-flower-pot", "--viewpoint", "contour", "--choice", "centre"],
            "contour has no setting choice",
        ),
        (["deliver", "--sample", "green-flower-pot", "--max-steps", "0"], "max-steps"),
        (["deliver", "--sample", "green-flower-pot", "--answer", " "], "text"),
        (["deliver", "--sample", "green-flower-pot", "--answer", "x" * 1001], "text"),
        (["serve", "kitchen"], "there is no service 'kitchen'"),
    ],
)
def test_wrong_input_ends_with_code_2_and_says_what_was_wrong(arguments: list[str], said: str, tmp_path: Path) -> None:
    (tmp_path / "broken.json").write_text('{"name": "x"}')
    (tmp_path / "binary.json").write_bytes(b"\xff\xfe\x00\x9d")
    places = {"folder": tmp_path, "broken": tmp_path / "broken.json", "binary": tmp_path / "binary.json"}
    result = RUNNER.invoke(app, [a.format(**places) if a.startswith("{") else a for a in arguments])
    assert result.exit_code == 2, result.output
    assert said in result.stderr
    assert "Traceback" not in result.output


@pytest.mark.slow  # half a minute of patience, twice
def test_services_that_are_not_there_end_a_delivery_with_a_reason_and_code_1(tmp_path: Path) -> None:
    nowhere = ",".join(f"{n}=http://127.0.0.1:{p}" for n, p in free_ports(["llm_parser", "sim"]).items())
    result = RUNNER.invoke(
        app, ["deliver", "--sample", "green-flower-pot", "--services", nowhere, "--out", str(tmp_path), "--json"]
    )
    assert result.exit_code == 1
    assert json.loads(result.stdout)["outcome"] == "service_unreachable"


def test_a_model_that_there_is_not_is_refused_before_the_first_flight(tmp_path: Path) -> None:
    out = tmp_path / "runs"
    result = RUNNER.invoke(app, ["deliver", "--sample", "green-flower-pot", "--backend", "qwen", "--out", str(out)])
    assert result.exit_code == 2
    assert "no model 'qwen'; there is embedded" in result.stderr
    assert [p.name for p in out.iterdir()] == ["logs"], "nothing was flown, so there is no record"


def test_at_least_six_samples_ship_and_each_is_sound() -> None:
    samples = [sample_library.load(name) for name in sample_library.names()]
    assert len(samples) >= 6
    assert [s.name for s in samples] == sample_library.names()
    assert {b.kind for s in samples for b in s.scene.buildings if b.id == s.scene.target} == {
        "low_rise",
        "high_rise",
        "villa",
        "cultural",
    }
    assert {s.difficulty for s in samples} == {"easy", "moderate", "hard"}
    listing = RUNNER.invoke(app, ["samples"])
    assert listing.exit_code == 0
    assert all(s.name in listing.stdout for s in samples)
