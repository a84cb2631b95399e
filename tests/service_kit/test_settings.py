"""Settings are typed, bounded, and say what would have been right."""

from pathlib import Path
from typing import ClassVar, Literal

import pytest
from pydantic import Field

from service_kit.settings import (
    BadSetting,
    HttpAddress,
    Secret,
    ServiceSettings,
    Settings,
    Token,
    Variable,
    revealed,
    without_password,
)


class Kitchen(Settings):
    """One field of every type there is."""

    prefixes: ClassVar = ("KITCHEN_",)

    kitchen_token: Token | None = Field(None, description="Opens the door.")
    kitchen_store: Secret | None = None
    ovens: int = Field(7, ge=0, le=10, description="How many.")
    heat: float = Field(1.0, ge=0.0, le=10.0)
    fan: bool = False
    menu: Literal["short", "long"] = "short"
    supplier_url: HttpAddress = "http://127.0.0.1:8000"
    cellar: Path = Path("cellar")
    cook: str | None = None


class Strict(Settings):
    licence_token: Token


def test_what_is_not_set_has_its_default_and_empty_counts_as_not_set() -> None:
    assert Kitchen.read({"OVENS": "", "COOK": "", "KITCHEN_TOKEN": "", "KITCHEN_TOKEN_FILE": ""}) == Kitchen()


def test_values_come_in_the_types_of_their_fields() -> None:
    given = {"OVENS": "3", "HEAT": "2.5", "FAN": "on", "MENU": "long", "CELLAR": "/srv", "COOK": "Ada"}
    settings = Kitchen.read(given | {"SUPPLIER_URL": "https://shop.example/"})
    assert settings == Kitchen(
        ovens=3, heat=2.5, fan=True, menu="long", cellar=Path("/srv"), cook="Ada", supplier_url="https://shop.example"
    )


def test_a_secret_may_lie_in_a_file(tmp_path: Path) -> None:
    file = tmp_path / "token"
    file.write_text("abc\n")
    assert revealed(Kitchen.read({"KITCHEN_TOKEN_FILE": str(file)}).kitchen_token) == "abc"
    assert revealed(Kitchen.read({"KITCHEN_TOKEN": "x", "KITCHEN_TOKEN_FILE": str(file)}).kitchen_token) == "x"


def test_a_secret_is_not_shown_when_settings_are_printed() -> None:
    assert "hunter2" not in repr(Kitchen.read({"KITCHEN_TOKEN": "hunter2", "KITCHEN_STORE": "hunter2"}))


def test_an_unreadable_file_of_a_secret_is_named() -> None:
    with pytest.raises(BadSetting, match="KITCHEN_TOKEN_FILE=/nowhere/token: No such file"):
        Kitchen.read({"KITCHEN_TOKEN_FILE": "/nowhere/token"})


def test_an_empty_file_of_a_secret_does_not_leave_the_door_open(tmp_path: Path) -> None:
    file = tmp_path / "token"
    file.write_text("\n")
    with pytest.raises(BadSetting, match=r"KITCHEN_TOKEN_FILE=.*the file is empty; write the secret into it"):
        Kitchen.read({"KITCHEN_TOKEN_FILE": str(file)})


def test_a_token_that_fits_no_header_is_refused_without_being_shown(tmp_path: Path) -> None:
    with pytest.raises(BadSetting, match=r"^KITCHEN_TOKEN: a token is printable ASCII") as refused:
        Kitchen.read({"KITCHEN_TOKEN": "hunter2 x"})
    assert "hunter2" not in str(refused.value)
    file = tmp_path / "token"
    file.write_text("one\ntwo\n")
    with pytest.raises(BadSetting, match=r"^KITCHEN_TOKEN_FILE=.*token: a token is printable ASCII"):
        Kitchen.read({"KITCHEN_TOKEN_FILE": str(file)})


@pytest.mark.parametrize(("value", "expected"), [("on", True), ("0", False), ("TRUE", True), ("no", False)])
def test_flags_read_the_usual_words(value: str, expected: bool) -> None:
    assert Kitchen.read({"FAN": value}).fan is expected


@pytest.mark.parametrize(
    ("variable", "value", "right"),
    [
        ("OVENS", "eleven", "give a whole number from 0 to 10"),
        ("OVENS", "11", "give a whole number from 0 to 10"),
        ("OVENS", "2.5", "give a whole number from 0 to 10"),
        ("HEAT", "nan", "give a number from 0 to 10"),
        ("HEAT", "-1", "give a number from 0 to 10"),
        ("FAN", "perhaps", "say on or off"),
        ("MENU", "none", "choose one of short, long"),
        ("SUPPLIER_URL", "shop.example", "give an http:// or https:// address"),
        ("SUPPLIER_URL", "http://", "give an http:// or https:// address"),
    ],
)
def test_a_wrong_value_is_told_with_its_variable_and_what_would_be_right(variable: str, value: str, right: str) -> None:
    with pytest.raises(BadSetting) as refused:
        Kitchen.read({variable: value})
    assert str(refused.value) == f"{variable}={value}: {right}"


def test_all_wrong_values_are_told_at_once() -> None:
    with pytest.raises(BadSetting, match=r"OVENS=many: .*; FAN=perhaps: "):
        Kitchen.read({"OVENS": "many", "FAN": "perhaps"})


def test_a_setting_that_must_be_there_says_how_to_give_it() -> None:
    with pytest.raises(BadSetting, match="LICENCE_TOKEN is not set; set it or LICENCE_TOKEN_FILE"):
        Strict.read({})


def test_a_misspelt_or_unknown_variable_is_told() -> None:
    said = Kitchen.unknown(
        {
            "OVENS": "1",
            "KITCHEN_TOKEN_FILE": "x",
            "KITCHEN_TOKENS": "x",
            "SUPLIER_URL": "x",
            "KITCHEN_X": "1",
            "TOKEN_FILE": "x",
            "PATH": "/",
        }
    )
    assert said == [
        "KITCHEN_TOKENS is set, but there is no such setting; did you mean KITCHEN_TOKEN?",
        "KITCHEN_X is set, but there is no such setting; did you mean KITCHEN_TOKEN?",
        "SUPLIER_URL is set, but there is no such setting; did you mean SUPPLIER_URL?",
        "TOKEN_FILE is set, but there is no such setting; did you mean KITCHEN_TOKEN_FILE?",
    ]
    assert Kitchen.unknown({"KITCHEN_URL": "x"}, frozenset({"KITCHEN_URL"})) == []


def test_a_class_knows_name_type_bounds_default_and_meaning_of_its_variables() -> None:
    assert Kitchen.variables()[:6] == (
        Variable("KITCHEN_TOKEN", "secret", "", "Opens the door.", True),
        Variable("KITCHEN_STORE", "secret", "", "", True),
        Variable("OVENS", "whole number from 0 to 10", "7", "How many.", False),
        Variable("HEAT", "number from 0 to 10", "1", "", False),
        Variable("FAN", "on | off", "off", "", False),
        Variable("MENU", "short | long", "short", "", False),
    )
    assert [variable.kind for variable in Kitchen.variables()[6:]] == ["address", "path", "text"]


def test_every_service_reads_where_to_listen() -> None:
    settings = ServiceSettings.read({"PORT": "9000", "HOST": "0.0.0.0", "LOG_LEVEL": "debug"})
    assert (settings.host, settings.port, settings.log_level) == ("0.0.0.0", 9000, "debug")
    with pytest.raises(BadSetting, match="PORT=70000: give a whole number from 1 to 65535"):
        ServiceSettings.read({"PORT": "70000"})


def test_a_url_is_shown_without_its_password() -> None:
    assert without_password("redis://u:pw@host:6379/0?x=pw") == "redis://host:6379/0"
