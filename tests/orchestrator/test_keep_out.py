"""The operator's volumes that no flight enters: the file, and what a delivery may do about them."""

from pathlib import Path

import pytest
from pydantic import ValidationError

from contracts.flight_limits import FlightLimits
from contracts.keep_out import MAX_KEEP_OUT, KeepOut
from orchestrator.settings import OrchestratorSettings
from service_kit.settings import BadSetting

WIRES = """
[[keep_out]]
name = "wires"
outline = [{x = 0, y = 0}, {x = 0, y = 2}, {x = 30, y = 2}, {x = 30, y = 0}]
min_height_m = 5
max_height_m = 8
"""


def limits(tmp_path: Path, text: str) -> FlightLimits:
    file = tmp_path / "keep-out.toml"
    file.write_text(text)
    return OrchestratorSettings(flight_keep_out=file).flight_limits


def test_the_operators_file_becomes_part_of_the_limits(tmp_path: Path) -> None:
    (volume,) = limits(tmp_path, WIRES).keep_out
    assert (volume.name, volume.min_height_m, volume.max_height_m) == ("wires", 5.0, 8.0)
    assert OrchestratorSettings().flight_limits.keep_out == ()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (WIRES.replace("{x = 30, y = 2}, {x = 30, y = 0}", "{x = 30, y = 0}, {x = 30, y = 2}"), "walls 1 and 3 cross"),
        (WIRES.replace(", {x = 30, y = 2}, {x = 30, y = 0}", ""), "outline"),
        (WIRES.replace("max_height_m = 8", "max_height_m = 4"), "min_height_m must be less than max_height_m"),
        (WIRES.replace('"wires"', '"over the road"'), "name"),
        (WIRES.replace("min_height_m", "floor"), "floor"),
        ("", "keep_out"),
        ("[[keep", "not TOML"),
    ],
)
def test_a_file_that_is_none_is_told_with_what_is_wrong(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(BadSetting, match=said) as refused:
        limits(tmp_path, text)
    assert str(refused.value).startswith("FLIGHT_KEEP_OUT=")


def test_a_file_that_is_not_there_is_told(tmp_path: Path) -> None:
    with pytest.raises(BadSetting, match="name a readable file"):
        _ = OrchestratorSettings(flight_keep_out=tmp_path / "none.toml").flight_limits


def test_a_request_adds_volumes_and_removes_none(tmp_path: Path) -> None:
    operators = limits(tmp_path, WIRES)
    yard = KeepOut.model_validate(operators.keep_out[0].model_dump() | {"name": "yard", "max_height_m": 20.0})
    assert operators.tightened(FlightLimits()).keep_out == operators.keep_out
    assert operators.tightened(FlightLimits(keep_out=(yard,))).keep_out == (*operators.keep_out, yard)
    assert operators.tightened(FlightLimits(keep_out=operators.keep_out)).keep_out == operators.keep_out
    with pytest.raises(ValidationError, match=f"at most {MAX_KEEP_OUT}"):
        FlightLimits(keep_out=(yard,) * (MAX_KEEP_OUT + 1))
