"""What outsiders expect of a project: one version everywhere, the same checks wherever they run, no known holes."""

import re
import tomllib
from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).parent.parent
PROJECT: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
LOCK: dict[str, Any] = tomllib.loads((ROOT / "uv.lock").read_text(encoding="utf-8"))
MAKEFILE = (ROOT / "Makefile").read_text(encoding="utf-8")


def recipe(target: str) -> str:
    """A target's line with what it needs, and its commands."""
    found = re.search(rf"^{target}:.*\n(?:\t.*\n)*", MAKEFILE, re.MULTILINE)
    assert found, f"the Makefile has no target {target}"
    return found.group(0)


def numbers(version: str) -> tuple[int, ...]:
    return tuple(int(part) for part in version.split(".")[:3])


def test_the_version_is_the_changelog_s_newest_and_that_of_the_images() -> None:
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    compose = yaml.safe_load((ROOT / "docker-compose.yml").read_text(encoding="utf-8"))
    ours = {s["image"] for s in compose["services"].values() if s["image"].startswith("logisticsvln/")}
    assert re.findall(r"^## (\S+)", changelog, re.MULTILINE)[0] == PROJECT["version"]
    assert {image.partition(":")[2] for image in ours} == {PROJECT["version"]}
    assert {p["version"] for p in LOCK["package"] if p["name"] == "logisticsvln"} == {PROJECT["version"]}


def test_the_workflow_runs_make_test_on_every_python_that_is_promised() -> None:
    job = yaml.safe_load((ROOT / ".github/workflows/test.yml").read_text(encoding="utf-8"))["jobs"]["test"]
    low, high = re.fullmatch(r">=3\.(\d+),<3\.(\d+)", PROJECT["requires-python"]).groups()  # type: ignore[union-attr]
    assert job["strategy"]["matrix"]["python"] == [f"3.{minor}" for minor in range(int(low), int(high))]
    assert any(step.get("run", "").startswith("make test ") for step in job["steps"])


def test_make_test_begins_with_lint_format_and_types() -> None:
    assert re.match(r"test: (.* )?check ", recipe("test"))
    for command in ("ruff check", "ruff format --check", "mypy"):
        assert command in recipe("check")


def test_before_a_commit_the_same_linters_run_as_in_make_check() -> None:
    hooks = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text(encoding="utf-8"))["repos"][0]["hooks"]
    entries = {hook["entry"].replace(" --force-exclude", "").removeprefix(".venv/bin/") for hook in hooks}
    checks = {line.strip().removeprefix("@$(BIN)/").removesuffix(" .") for line in recipe("check").splitlines()[1:]}
    assert entries == checks


@pytest.mark.parametrize(
    ("package", "mended_in"), [("opencv-python-headless", "4.12"), ("starlette", "0.49.1"), ("uvicorn", "0.32")]
)
def test_no_version_with_a_known_hole_may_be_installed(package: str, mended_in: str) -> None:
    (stated,) = [d for d in PROJECT["dependencies"] if re.match(rf"{package}(\[|[><=])", d)]
    floor = re.search(r"(?:>=|==)([\d.]+)", stated)
    assert floor, f"{stated}: state the oldest version that may be installed"
    assert numbers(floor.group(1)) >= numbers(mended_in)
    assert all(numbers(p["version"]) >= numbers(floor.group(1)) for p in LOCK["package"] if p["name"] == package)


def test_uvicorn_is_pinned_exactly_while_its_inner_parts_are_used() -> None:
    used = any("uvicorn.protocols" in p.read_text(encoding="utf-8") for p in (ROOT / "services").rglob("*.py"))
    pinned = any(d.startswith("uvicorn") and "==" in d for d in PROJECT["dependencies"])
    assert pinned or not used
