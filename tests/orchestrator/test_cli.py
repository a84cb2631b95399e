"""The command line: wrong inputs end with code 2 and one clear line; what it says of itself is true."""

import asyncio
import json
import socket
from pathlib import Path

import pytest
from typer.testing import CliRunner

from orchestrator import sample_library
from orchestrator.cli import app
from orchestrator.processes import CannotStart, Processes, free_ports, is_free, own_environment, parse_addresses

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
            "belongs to the paper",
        ),
        (["deliver", "--sample", "green-flower-pot", "--max-steps", "0"], "max-steps"),
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


def test_services_that_are_not_there_end_a_delivery_with_a_reason_and_code_1(tmp_path: Path) -> None:
    nowhere = ",".join(f"{n}=http://127.0.0.1:{p}" for n, p in free_ports(["llm_parser", "sim"]).items())
    result = RUNNER.invoke(
        app, ["deliver", "--sample", "green-flower-pot", "--services", nowhere, "--out", str(tmp_path), "--json"]
    )
    assert result.exit_code == 1
    assert json.loads(result.stdout)["outcome"] == "service_unreachable"


def test_a_service_that_ends_while_starting_is_reported_with_its_last_words(tmp_path: Path) -> None:
    ports = free_ports(["depth_assist"])
    environment = own_environment() | {"MAX_BODY_BYTES": "many"}
    group = Processes(ports, tmp_path / "logs", environment=environment)

    async def start() -> None:
        async with group:
            pass

    with pytest.raises(CannotStart, match="MAX_BODY_BYTES"):
        asyncio.run(start())
    assert group.children[0].process.returncode != 0


def test_a_taken_port_is_named_before_anything_is_started(tmp_path: Path) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        assert not is_free(port)
        group = Processes({"sim": port}, tmp_path / "logs", environment=own_environment())
        with pytest.raises(CannotStart, match=str(port)):
            group.start()
    assert not group.children


def test_addresses_are_read_by_name_and_the_rest_keep_their_usual_ports() -> None:
    at = parse_addresses("sim=http://127.0.0.1:9000, vlm_gateway=https://models.example")
    assert at.sim == "http://127.0.0.1:9000"
    assert at.vlm_gateway == "https://models.example"
    assert at.depth_assist == "http://127.0.0.1:8103"


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


def test_the_doctor_looks_at_everything_and_says_what_to_do(tmp_path: Path) -> None:
    result = RUNNER.invoke(app, ["doctor", "--json", "--out", str(tmp_path)])
    told = json.loads(result.stdout)
    assert {f["name"] for f in told["findings"]} == {
        "Python", "Packages", "Renderer", "Redis", "Ports", "Disk", "Samples",
    }  # fmt: skip
    assert result.exit_code == (0 if told["ok"] else 1)
    assert all(f["remedy"] for f in told["findings"] if not f["ok"])


def test_the_doctor_notices_a_redis_that_is_set_and_does_not_answer(tmp_path: Path) -> None:
    port = free_ports(["redis"])["redis"]
    result = RUNNER.invoke(
        app, ["doctor", "--json", "--out", str(tmp_path)], env={"REDIS_URL": f"redis://127.0.0.1:{port}/0"}
    )
    redis = next(f for f in json.loads(result.stdout)["findings"] if f["name"] == "Redis")
    assert not redis["ok"]
    assert result.exit_code == 1
