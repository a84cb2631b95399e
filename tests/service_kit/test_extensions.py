"""Extensions are found by name without importing them, and whatever is wrong with one names its package."""

import sys
from pathlib import Path

import pytest

from service_kit.extensions import BadExtension, extensions, loaded

GROUP = "logisticsvln.for_this_test"


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder that packages are installed into."""
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    return tmp_path


def install(site: Path, package: str, points: str, source: str = "") -> None:
    (site / f"{package}.py").write_text(source)
    info = site / f"{package}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[{GROUP}]\n{points}\n")


def test_without_packages_there_are_none() -> None:
    assert extensions(GROUP) == {}


def test_they_are_listed_by_name_without_being_imported_and_loaded_when_wanted(site: Path) -> None:
    install(site, "package_one", "red = package_one:THING", "THING = 'red thing'")
    install(site, "package_two", "blue = package_two:THING", "raise RuntimeError('not asked for')")
    found = extensions(GROUP)
    assert list(found) == ["blue", "red"]
    assert "package_one" not in sys.modules
    assert loaded(found["red"]) == "red thing"


@pytest.mark.parametrize(
    ("package", "source", "why"),
    [
        ("broken_import", "import there_is_no_such_module", "ModuleNotFoundError"),
        ("broken_code", "raise RuntimeError('its own fault')", "its own fault"),
        ("broken_name", "OTHER = 1", "AttributeError"),
    ],
)
def test_one_that_fails_names_its_package_and_why(site: Path, package: str, source: str, why: str) -> None:
    install(site, package, f"red = {package}:THING", source)
    with pytest.raises(BadExtension, match=f"package '{package}'.*{why}"):
        loaded(extensions(GROUP)["red"])


def test_two_packages_with_one_name_are_refused_with_both_named(site: Path) -> None:
    install(site, "package_three", "red = package_three:THING")
    install(site, "package_four", "red = package_four:THING")
    with pytest.raises(BadExtension, match=r"package_(three|four).*package_(three|four).*'red'"):
        extensions(GROUP)


def test_a_name_that_is_built_in_is_refused(site: Path) -> None:
    install(site, "package_five", "red = package_five:THING")
    with pytest.raises(BadExtension, match="'red', which is built in"):
        extensions(GROUP, reserved=("red",))


def test_a_name_that_is_not_safe_in_a_path_is_refused(site: Path) -> None:
    install(site, "package_six", "../red = package_six:THING")
    with pytest.raises(BadExtension, match="names hold letters"):
        extensions(GROUP)
