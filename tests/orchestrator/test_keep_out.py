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
        (WIRES.replace("{x = 30, y = 2}, {x = 30, y = 0}", "{x = 30, y = 0}, {x = 30, y = 2}"), "sides 1 and 3 cross"),
        (WIRES.replace(", {x = 30, y = 2}, {x = 30, y = 0}", ""), "outline"),
        (WIRES.replace("max_height_m = 8", "max_height_m = 4"), "min_height_m must be less than max_height_m"),
        (WIRES.replace('"wires"', '"over the road"'), "name"),
        (WIRES.replace("min_height_m", "floor"), "floor"),
        ("", "keep_out"),
        ("[[keep", "not TOML"),
        (WIRES.replace("y = 2", "y = 0.5").replace("x = 30", "x = 1.5"), "0.75 m2 are enclosed; enclose at least 1 m2"),
        (WIRES + WIRES, "two keep-out volumes are named wires"),
        pytest.param(WIRES.replace("_m = 8", "_m = " + "9" * 5000), "integer", id="digits"),
        pytest.param("a = " + "[" * 5000 + "]" * 5000, "too deep", id="brackets"),
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
    more = [yard.model_dump() | {"name": f"yard-{k}"} for k in range(MAX_KEEP_OUT + 1)]
    assert len(FlightLimits.model_validate({"keep_out": more[1:]}).keep_out) == MAX_KEEP_OUT
    with pytest.raises(ValidationError, match=f"at most {MAX_KEEP_OUT}"):
        FlightLimits.model_validate({"keep_out": more})
    with pytest.raises(ValidationError, match="two keep-out volumes are named yard"):
        FlightLimits(keep_out=(yard, yard))


def test_a_small_outline_is_told_the_same_either_way_round(tmp_path: Path) -> None:
    small = [{"x": 0.0, "y": 0.0}, {"x": 0.9, "y": 0.0}, {"x": 0.9, "y": 0.9}, {"x": 0.0, "y": 0.9}]
    for outline in (small, small[::-1]):
        with pytest.raises(ValidationError, match=r"0\.81 m2 are enclosed") as refused:
            KeepOut.model_validate({"name": "small", "outline": outline})
        assert "footprint" not in str(refused.value)


def test_a_file_with_a_byte_order_mark_is_read(tmp_path: Path) -> None:
    assert len(limits(tmp_path, "\ufeff" + WIRES).keep_out) == 1
