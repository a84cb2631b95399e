"""Windows lie where the scene document says: hand-computed on simple houses."""

import math

import pytest

from contracts.geometry import Point2
from contracts.scene import BalconyPlan, Building, WindowGrid
from contracts.scene_layout import columns_of, facades, floor_outline, wall_height_m, window_slot, window_slots


def house(**changes: object) -> Building:
    """12 x 8 m, counter-clockwise from the south-west corner: facade 0 looks south, 1 east, 2 north, 3 west."""
    corners = tuple(Point2(x=x, y=y) for x, y in ((0, 0), (12, 0), (12, 8), (0, 8)))
    grid = WindowGrid(width_m=1.0, height_m=1.5, sill_m=1.0, pitch_m=3.0, margin_m=1.0)
    given: dict[str, object] = {"id": "h", "kind": "low_rise", "footprint": corners, "floors": 4, "windows": grid}
    return Building.model_validate(given | changes)


def test_facades_face_outwards_in_the_footprints_order() -> None:
    assert [f.normal for f in facades(house())] == [(0, -1), (1, 0), (0, 1), (-1, 0)]
    assert [f.length_m for f in facades(house())] == [12, 8, 12, 8]


def test_a_facade_holds_as_many_columns_as_fit_between_its_margins() -> None:
    # 12 m: 10 between the margins = 1 + 3 * 3, 4 columns; 8 m: 6 between, 1 + 3 fits and 1 + 6 does not, 2
    assert [columns_of(house(), k) for k in range(4)] == [4, 2, 4, 2]


def test_a_facade_too_short_for_a_window_has_none() -> None:
    narrow = house(footprint=tuple(Point2(x=x, y=y) for x, y in ((0, 0), (12, 0), (12, 2.5), (0, 2.5))))
    assert columns_of(narrow, 1) == 0


def test_a_window_is_centred_in_the_grid_of_its_facade_and_floor() -> None:
    slot = window_slot(house(), facade=0, floor=3, column=0)
    # columns at 6 -/+ 4.5 and 6 -/+ 1.5; floor 3 starts at 6 m, the sill at 7, the middle at 7.75
    assert slot.centre == pytest.approx((1.5, 0.0, 7.75))
    assert slot.sill_z == pytest.approx(7.0)
    north = window_slot(house(), facade=2, floor=1, column=0)
    assert north.centre == pytest.approx((10.5, 8.0, 1.75))
    assert north.normal == (0, 1)


def test_every_window_is_listed_once() -> None:
    slots = window_slots(house())
    assert len(slots) == 4 * (4 + 2 + 4 + 2)
    assert len({(s.facade, s.floor, s.column) for s in slots}) == len(slots)


def test_a_setback_moves_the_walls_in_and_keeps_the_columns() -> None:
    tiered = house(setback_m=0.5, windows=WindowGrid(width_m=1.0, sill_m=1.0, pitch_m=2.0, margin_m=1.0))
    assert [c for p in floor_outline(tiered, 3) for c in p] == pytest.approx([1, 1, 11, 1, 11, 7, 1, 7])
    assert columns_of(tiered, 0) == 4  # the top floor's wall is 9 m long: 7 between the margins, 1 + 3 * 2
    low, high = (window_slot(tiered, 0, floor, 1) for floor in (1, 4))
    assert (low.centre[0], low.centre[1], high.centre[1]) == pytest.approx((high.centre[0], 0.0, 1.5))


def test_an_octagon_sets_back_evenly() -> None:
    corners = tuple(Point2(x=10 * math.cos(a), y=10 * math.sin(a)) for a in (math.pi / 4 * k for k in range(8)))
    octagon = house(footprint=corners, setback_m=1.0)
    apothem = 10 * math.cos(math.pi / 8)
    for x, y in floor_outline(octagon, 2):
        assert math.hypot(x, y) == pytest.approx((apothem - 1) / math.cos(math.pi / 8))


@pytest.mark.parametrize(
    ("facade", "floor", "column", "reason"),
    [(4, 1, 0, "facades 0..3"), (0, 5, 0, "floors 1..4"), (1, 1, 2, "2 window columns")],
)
def test_a_window_that_is_not_there_is_refused_with_what_is(facade: int, floor: int, column: int, reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        window_slot(house(), facade, floor, column)


def test_a_setback_that_eats_the_building_is_refused() -> None:
    with pytest.raises(ValueError, match="leaves no floor"):
        floor_outline(house(setback_m=2.0), 4)


def test_balconies_start_at_their_floor() -> None:
    plan = BalconyPlan(facades=(0,), columns=(1, 2), from_floor=2)
    built = house(balconies=(plan,))
    assert window_slot(built, 0, 1, 1).balcony is None
    assert window_slot(built, 0, 2, 1).balcony == plan
    assert window_slot(built, 0, 2, 0).balcony is None
    assert wall_height_m(built) == 12.0


def test_a_footprint_that_runs_clockwise_is_refused() -> None:
    with pytest.raises(ValueError, match="counter-clockwise"):
        house(footprint=tuple(Point2(x=x, y=y) for x, y in ((0, 0), (0, 8), (12, 8), (12, 0))))
