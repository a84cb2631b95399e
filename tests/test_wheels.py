"""`make setup` compiles nothing (all that it installs has wheels for the Pythons that we name, on Linux) and refuses a
Python that can't run the project."""

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from packaging.markers import Marker, default_environment
from packaging.tags import Tag, compatible_tags, cpython_tags
from packaging.utils import parse_wheel_filename

from scripts.which_python import problem_of

ROOT = Path(__file__).parents[1]
LOCK: list[dict[str, Any]] = tomllib.loads((ROOT / "uv.lock").read_text(encoding="utf-8"))["package"]
LOCKED = {package["name"]: package for package in LOCK}
GLIBC = 36
"""Debian 12's; wheels for older ones run there."""
PLATFORMS = [f"manylinux_2_{minor}_x86_64" for minor in range(GLIBC, 4, -1)] + [
    f"manylinux{old}_x86_64" for old in ("2014", "2010", "1")
]
OF_NO_INDEX = {"logisticsvln"}


def tags(python: tuple[int, int]) -> set[Tag]:
    return {*cpython_tags(python, platforms=PLATFORMS), *compatible_tags(python, platforms=PLATFORMS)}


def named(dependencies: list[dict[str, Any]], python: tuple[int, int]) -> Iterator[tuple[str, str]]:
    """The packages, and their extras, that a list of dependencies wants with that Python on Linux."""
    version = ".".join(map(str, python))
    here = default_environment() | {"python_version": version, "python_full_version": f"{version}.1"}
    here |= {"sys_platform": "linux", "platform_system": "Linux", "platform_machine": "x86_64", "os_name": "posix"}
    here |= {"implementation_name": "cpython", "platform_python_implementation": "CPython"}
    for one in dependencies:
        if "marker" not in one or Marker(one["marker"]).evaluate({key: str(value) for key, value in here.items()}):
            yield from ((one["name"], extra) for extra in ("", *one.get("extra", ())))


def installed(python: tuple[int, int]) -> set[str]:
    """What `make setup` installs with that Python: the extra `all` and the group `dev`, with what they need."""
    ours = LOCKED["logisticsvln"]
    left = [("logisticsvln", "all"), ("logisticsvln", ""), *named(ours["dev-dependencies"]["dev"], python)]
    seen: set[tuple[str, str]] = set()
    while left:
        if (wanted := left.pop()) in seen:
            continue
        seen.add(wanted)
        package, extra = LOCKED[wanted[0]], wanted[1]
        more = package.get("optional-dependencies", {}).get(extra, []) if extra else package.get("dependencies", [])
        left += named(more, python)
    return {name for name, _ in seen} - OF_NO_INDEX


def has_a_wheel(name: str, python: tuple[int, int]) -> bool:
    """In one of the versions that are locked: some have another for each Python."""
    of_it = [package for package in LOCK if package["name"] == name]
    names = [wheel["url"].rpartition("/")[2] for package in of_it for wheel in package.get("wheels", ())]
    return any(parse_wheel_filename(file)[3] & tags(python) for file in names)


def taken() -> list[tuple[int, int]]:
    """The Pythons that the workflow runs the tests with."""
    workflow = (ROOT / ".github" / "workflows" / "test.yml").read_text(encoding="utf-8")
    matrix = re.search(r"python: \[(.*)\]", workflow)
    assert matrix is not None
    return [(int(major), int(minor)) for major, minor in re.findall(r"(\d+)\.(\d+)", matrix[1])]


@pytest.mark.parametrize("python", taken(), ids=str)
def test_nothing_that_setup_installs_is_compiled(python: tuple[int, int]) -> None:
    packages = installed(python)
    assert len(packages) > 60
    assert {name for name in packages if not has_a_wheel(name, python)} == set()


def test_a_python_without_wheels_is_found() -> None:
    assert not has_a_wheel("pybullet", (3, 12))
    assert has_a_wheel("pybullet", (3, 11))
    assert "pybullet" in installed((3, 11))
    assert "pybullet" not in installed((3, 12))


@pytest.mark.parametrize(
    ("python", "sqlite", "said"),
    [
        ((3, 11, 2), (3, 40, 1), None),
        ((3, 12, 1), (3, 45, 1), None),
        ((3, 12, 1), (3, 40, 1), "Python 3.12 wants SQLite 3.42 or newer; {} has 3.40.1"),
        ((3, 10, 0), (3, 45, 1), "Python 3.11 or 3.12 is needed; {} is 3.10"),
        ((3, 13, 0), (3, 45, 1), "Python 3.11 or 3.12 is needed; {} is 3.13"),
    ],
)
def test_a_python_that_cannot_run_the_project_is_told_why(
    python: tuple[int, ...], sqlite: tuple[int, ...], said: str | None
) -> None:
    found = problem_of(python, sqlite)
    assert found is None if said is None else found.startswith(said)
