"""The doctor looks at this machine, and at how a model writes boxes."""

import json
import os
import subprocess
import sys
from pathlib import Path

from typer.testing import CliRunner

from command_line.doctor import required_packages
from command_line.main import app
from launcher.processes import free_ports
from service_kit.app import create_app
from tests.conftest import Serve
from tests.services.vlm_gateway.openai_mock import OpenAiMock, says

RUNNER = CliRunner()


def test_the_doctor_looks_at_everything_and_says_what_to_do(tmp_path: Path) -> None:
    result = RUNNER.invoke(app, ["doctor", "--json", "--out", str(tmp_path)])
    told = json.loads(result.stdout)
    assert {f["name"] for f in told["findings"]} == {
        "Python", "Packages", "Renderer", "Settings", "Services", "Redis", "Ports", "Disk", "Samples",
    }  # fmt: skip
    assert result.exit_code == (0 if told["ok"] else 1)
    assert all(f["remedy"] for f in told["findings"] if not f["ok"])


def test_a_machine_on_which_the_tests_run_is_a_good_one(tmp_path: Path) -> None:
    result = RUNNER.invoke(app, ["doctor", "--json", "--out", str(tmp_path)], env={"REDIS_URL": ""})
    told = json.loads(result.stdout)
    assert [f for f in told["findings"] if not f["ok"]] == []
    assert (told["ok"], result.exit_code) == (True, 0)


def test_only_packages_that_flying_needs_are_looked_for() -> None:
    requirements = [
        "aiohttp>=3.11",
        "uvicorn[standard]==0.38.0",
        "pybullet>=3.2.6; (python_version < '9.0') and extra == 'sim'",
        "pybullet-of-another-python>=3.2.8; (python_version >= '9.0') and extra == 'sim'",
        'matplotlib>=3.9; extra == "eval"',
        "torch>=2.6; extra == 'train'",
        "torch>=2.6; extra == 'all'",
        "opentelemetry-sdk>=1.30; extra == 'otel'",
    ]
    assert required_packages(requirements) == ["aiohttp", "pybullet", "uvicorn"]


def test_a_token_file_that_cannot_be_read_is_a_finding(tmp_path: Path) -> None:
    result = RUNNER.invoke(app, ["doctor", "--json", "--out", str(tmp_path)], env={"SIM_TOKEN_FILE": "/nowhere/token"})
    settings = next(f for f in json.loads(result.stdout)["findings"] if f["name"] == "Settings")
    assert not settings["ok"]
    assert "SIM_TOKEN_FILE=/nowhere/token: No such file" in settings["found"]


def test_the_doctor_asks_running_services_whether_the_tokens_fit(tmp_path: Path, serve: Serve) -> None:
    guarded = serve(create_app("sim", max_body_bytes=100, token="s3cret"))
    free = serve(create_app("depth_assist", max_body_bytes=100))
    nowhere = f"http://127.0.0.1:{free_ports(['x'])['x']}"
    at = {"SIM_URL": guarded, "DEPTH_ASSIST_URL": free, "LLM_PARSER_URL": nowhere, "VLM_GATEWAY_URL": nowhere}
    for token, fits in (("s3cret", True), ("old", False), ("", False)):
        result = RUNNER.invoke(app, ["doctor", "--json", "--out", str(tmp_path)], env=at | {"SIM_TOKEN": token})
        services = next(f for f in json.loads(result.stdout)["findings"] if f["name"] == "Services")
        assert services["ok"] is fits
        assert ("takes our token" if fits else "SIM_TOKEN") in services["found"]
        assert f"depth_assist at {free} asks for no token" in services["found"]
        assert "llm_parser" not in services["found"]
        assert bool(services["remedy"]) is not fits


def test_the_doctor_notices_a_redis_that_is_set_and_does_not_answer(tmp_path: Path) -> None:
    port = free_ports(["redis"])["redis"]
    result = RUNNER.invoke(
        app, ["doctor", "--json", "--out", str(tmp_path)], env={"REDIS_URL": f"redis://127.0.0.1:{port}/0"}
    )
    redis = next(f for f in json.loads(result.stdout)["findings"] if f["name"] == "Redis")
    assert not redis["ok"]
    assert result.exit_code == 1


def calibrate(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """`logisticsvln doctor --calibrate`, whose output is another process's."""
    command = [sys.executable, "-m", "command_line", "doctor", "--calibrate", *arguments]
    return subprocess.run(command, env=os.environ | environment, capture_output=True, text=True, timeout=120)


def test_without_a_running_gateway_a_calibration_starts_one(tmp_path: Path) -> None:
    mock = OpenAiMock().start()
    config = tmp_path / "gateway.toml"
    config.write_text(
        f'[models.m]\nbackend = "chat"\npreset = "generic-vision"\nmodel = "x"\nbase_url = "{mock.url}"\n'
    )
    mock.will(says("I see no shapes."))
    try:
        ran = calibrate("m", "--out", str(tmp_path), "--rounds", "1", "--json", GATEWAY_CONFIG=str(config))
    finally:
        mock.stop()
    told = json.loads(ran.stdout)
    assert (ran.returncode, told["certainty"], told["shapes_shown"], told["shapes_told"]) == (1, "none", 6, 0)


def test_a_calibration_before_a_gateway_that_is_not_there_says_so() -> None:
    ran = calibrate("m", "--gateway", "http://127.0.0.1:9")
    assert (ran.returncode, ran.stdout.count("showing m")) == (1, 1)
    assert "can't reach" in ran.stderr
    assert "Traceback" not in ran.stderr
