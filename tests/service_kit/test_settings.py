"""Settings are typed, bounded, and say what would have been right."""

from pathlib import Path

import pytest

from service_kit.settings import BadSetting, Settings, without_password


def test_a_secret_may_lie_in_a_file(tmp_path: Path) -> None:
    file = tmp_path / "token"
    file.write_text("abc\n")
    assert Settings({"TOKEN_FILE": str(file)}).text("TOKEN") == "abc"
    assert Settings({"TOKEN": "x", "TOKEN_FILE": str(file)}).text("TOKEN") == "x"


def test_an_unreadable_file_is_named() -> None:
    with pytest.raises(BadSetting, match="TOKEN_FILE=/nowhere/token"):
        Settings({"TOKEN_FILE": "/nowhere/token"}).text("TOKEN")


def test_empty_counts_as_not_set() -> None:
    settings = Settings({"A": ""})
    assert settings.text("A", "default") == "default"
    assert settings.integer("A", 7, 0, 10) == 7
    with pytest.raises(BadSetting, match="A is not set"):
        settings.required("A")


@pytest.mark.parametrize(("value", "expected"), [("on", True), ("0", False), ("TRUE", True), ("no", False)])
def test_flags_read_the_usual_words(value: str, expected: bool) -> None:
    assert Settings({"F": value}).flag("F", not expected) is expected


@pytest.mark.parametrize("value", ["eleven", "11", "nan", "-1"])
def test_a_number_out_of_bounds_is_refused(value: str) -> None:
    with pytest.raises(BadSetting, match=r"N=.*from 0 to 10"):
        Settings({"N": value}).number("N", 1.0, 0.0, 10.0)


def test_a_wrong_choice_lists_the_right_ones() -> None:
    with pytest.raises(BadSetting, match="choose one of a, b"):
        Settings({"C": "c"}).choice("C", "a", ("a", "b"))
    with pytest.raises(BadSetting, match="say on or off"):
        Settings({"F": "perhaps"}).flag("F")


def test_a_url_is_shown_without_its_password() -> None:
    assert without_password("redis://u:pw@host:6379/0?x=pw") == "redis://host:6379/0"
