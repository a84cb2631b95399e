"""Hedges, fences, poles, wires, awnings and signs of a scene document: optional, bounded, refused with a reason."""

from typing import Any

import pytest
from pydantic import ValidationError

from contracts.scene import Building, Ground, Light
from contracts.scene_street import OverheadWire

HOUSE: dict[str, Any] = {
    "id": "house",
    "kind": "low_rise",
    "floors": 3,
    "footprint": [{"x": -5, "y": -5}, {"x": 5, "y": -5}, {"x": 5, "y": 5}, {"x": -5, "y": 5}],
}
SPAN: dict[str, Any] = {"start": {"x": 0, "y": 0, "z": 6}, "end": {"x": 20, "y": 0, "z": 7}}


def line(length_m: float) -> dict[str, Any]:
    return {"start": {"x": 0, "y": 0}, "end": {"x": length_m, "y": 0}}


def test_a_scene_that_has_none_of_it_says_nothing_of_it() -> None:
    assert not {"hedges", "fences", "poles", "wires"} & set(Ground().model_dump())
    assert not {"awnings", "signs"} & set(Building.model_validate(HOUSE).model_dump())
    assert "glass" not in Light().model_dump()


def test_what_a_scene_has_of_it_comes_back() -> None:
    given = Ground.model_validate(
        {
            "hedges": [line(8)],
            "fences": [line(4) | {"kind": "wall"}],
            "poles": [{"position": {"x": 0, "y": 1}}],
            "wires": [SPAN],
        }
    )
    assert Ground.model_validate_json(given.model_dump_json()) == given
    house = Building.model_validate(HOUSE | {"awnings": [{"facade": 0, "column": 0}]})
    assert Building.model_validate_json(house.model_dump_json()) == house


@pytest.mark.parametrize(
    ("field", "value", "said"),
    [
        ("hedges", [line(0.1)], "0.3 to 60 m, not 0.10 m"),
        ("hedges", [line(61)], "0.3 to 60 m, not 61.00 m"),
        ("hedges", [line(5) | {"height_m": 9}], "less than or equal to 4"),
        ("fences", [line(5) | {"kind": "moat"}], "'wall', 'pickets' or 'bars'"),
        ("fences", [line(5)] * 61, "at most 60 items"),
        ("wires", [SPAN | {"end": {"x": 20, "y": 0, "z": 680}}], "a wire hangs no higher than 60 m, not 680 m"),
        ("wires", [SPAN | {"sag_m": 5.0} | {"end": {"x": 20, "y": 0, "z": 3}}], "hangs down to"),
        ("wires", [SPAN | {"end": {"x": 0, "y": 0.1, "z": 9}}], "0.5 to 150 m of the plan, not 0.10 m"),
        ("wires", [SPAN | {"diameter_m": 0.0}], "greater than or equal to 0.004"),
        ("poles", [{"position": {"x": 0, "y": 0}, "height_m": 40}], "less than or equal to 20"),
    ],
)
def test_what_is_wrong_with_a_street_is_said(field: str, value: object, said: str) -> None:
    with pytest.raises(ValidationError, match=said):
        Ground.model_validate({field: value})


@pytest.mark.parametrize(
    ("field", "value", "said"),
    [
        ("awnings", {"facade": 0, "column": 0, "drop_m": 1.0}, "building house: an awning would hang down to 1.52 m"),
        ("awnings", {"facade": 0, "column": 0, "drop_m": 1.0}, "drop_m of at most 0.72"),
        ("awnings", {"facade": 0, "column": 0, "columns": 0}, "greater than or equal to 1"),
        ("signs", {"facade": 0, "column": 0, "text": "   "}, "at least 1 character"),
        ("signs", {"facade": 0, "column": 0, "text": "x" * 25}, "at most 24 characters"),
        ("signs", {"facade": 0, "column": 0}, "Field required"),
    ],
)
def test_what_is_wrong_with_a_shopfront_is_said(field: str, value: object, said: str) -> None:
    with pytest.raises(ValidationError, match=said):
        Building.model_validate(HOUSE | {field: [value]})


def test_a_wire_hangs_lowest_by_its_sag_in_the_middle_between_level_ends() -> None:
    wire = OverheadWire.model_validate(SPAN | {"end": {"x": 20, "y": 0, "z": 6}, "sag_m": 0.7})
    assert [wire.height_m(share) for share in (0.0, 0.5, 1.0)] == pytest.approx([6.0, 5.3, 6.0])


@pytest.mark.parametrize(("sill_m", "height_m"), [(0.9, 1.0), (0.3, 1.456), (0.8, 1.2), (1.0, 0.9)])
def test_an_awning_hangs_as_low_as_its_refusal_says_that_it_may(sill_m: float, height_m: float) -> None:
    house = HOUSE | {"windows": {"sill_m": sill_m, "height_m": height_m}}
    with pytest.raises(ValidationError, match="drop_m of at most") as refused:
        Building.model_validate(house | {"awnings": [{"facade": 0, "column": 0, "drop_m": 1.5}]})
    most_m = float(str(refused.value).split("at most ")[1].split(" ")[0].rstrip("[,"))
    Building.model_validate(house | {"awnings": [{"facade": 0, "column": 0, "drop_m": most_m}]})
