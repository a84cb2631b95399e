"""Stand-off and upper edge of a facade, in a ray-cast world."""

import math

import numpy as np
import pytest

from navigation.camera import Depth, DepthView, Pose, pinhole
from navigation.facade import FacadeParameters, facade_top_m, stand_off_m, wall_at_row_m, wall_columns
from tests.navigation.raycast_world import Prism, World, rectangle

USUAL = FacadeParameters()
CAMERA = pinhole(200, 200, 90.0)


def _front(*prisms: Prism, z: float = 9.0, away: float = 9.0) -> Depth:
    """From `away` metres south of y = 0, looking north."""
    return World(prisms, ground=True).depth(Pose(0.0, -away, z, math.pi / 2), CAMERA)


def _block(top: float, y: float = 5.0, depth: float = 10.0, bottom: float = 0.0) -> Prism:
    return Prism(rectangle(0.0, y, 30.0, depth), bottom, top)


def _seen(depth: Depth) -> DepthView:
    return DepthView(pinhole(depth.shape[1], depth.shape[0], 90.0), depth)


def _top(depth: Depth, z: float = 9.0, stand_off: float = 9.0) -> float | None:
    return facade_top_m(_seen(depth), stand_off, z, USUAL)


def test_the_stand_off_is_the_facades_distance() -> None:
    assert stand_off_m(_seen(_front(_block(20.0))), USUAL) == pytest.approx(9.0)


def test_a_pole_in_front_does_not_change_the_stand_off() -> None:
    pole = Prism(rectangle(0.3, -4.0, 0.2, 0.2), 0.0, 30.0)
    assert stand_off_m(_seen(_front(_block(20.0), pole)), USUAL) == pytest.approx(9.0)


def test_without_a_facade_there_is_no_stand_off() -> None:
    assert stand_off_m(_seen(np.full((50, 50), np.inf, np.float32)), USUAL) is None
    assert stand_off_m(_seen(np.full((50, 50), np.nan, np.float32)), USUAL) is None


@pytest.mark.parametrize("top", [4.0, 10.0, 15.0, 17.5])
def test_the_top_of_a_flat_roof_is_measured_to_a_pixel(top: float) -> None:
    assert _top(_front(_block(top))) == pytest.approx(top, abs=9.0 / 100 * 1.5)


def test_a_balcony_cut_off_by_the_pictures_edge_is_not_the_walls_top() -> None:
    # the picture reaches up to 18 m; the slab's underside at 17.6 m hides the last of the wall
    slab = _block(17.9, y=-0.65, depth=1.3, bottom=17.6)
    assert _top(_front(_block(40.0), slab)) is None


def test_a_wall_that_reaches_the_pictures_edge_has_its_top_out_of_sight() -> None:
    assert _top(_front(_block(18.5))) is None


def test_a_higher_house_behind_is_not_the_facade() -> None:
    assert _top(_front(_block(6.0), _block(40.0, y=30.0))) == pytest.approx(6.0, abs=0.15)


def test_setbacks_of_upper_floors_belong_to_the_facade() -> None:
    storeys = [_block(4.0 * (k + 1), y=5.0 + 1.0 * k, bottom=4.0 * k) for k in range(3)]
    assert _top(_front(*storeys)) == pytest.approx(12.0, abs=0.2)


def test_a_receding_roof_is_not_wall() -> None:
    depth = _front(_block(9.0))
    slope = np.arange(200) < 100  # above the eaves, a roof of 30 degrees: depth = 9 / (1 - u / tan 30)
    u = (100 - np.arange(200) - 0.5) / 100
    with np.errstate(divide="ignore"):
        roof = np.where(u < 0.5, 9.0 / (1 - u / math.tan(math.radians(30.0))), np.inf)
    roof = np.where((roof > 0) & (roof < 14.0), roof, np.inf)
    depth[slope] = roof[slope, None]
    assert _top(depth) == pytest.approx(9.0, abs=0.2)


def test_a_roof_below_the_picture_gives_the_pictures_lower_edge() -> None:
    assert _top(_front(_block(6.0), z=30.0), z=30.0) == pytest.approx(21.0)


def test_a_picture_that_is_mostly_invalid_says_nothing() -> None:
    assert _top(np.full((200, 200), np.nan, np.float32)) is None


def test_glass_that_returns_nothing_is_no_top() -> None:
    glass = _front(_block(30.0))
    glass[:60, 75:] = np.nan
    assert _top(glass) is None
    glass[:60] = np.nan
    assert _top(glass) is None


def test_a_pane_that_the_pictures_edge_cuts_off_and_that_returns_nothing_is_no_sky() -> None:
    wall = _front(_block(30.0))
    wall[:60, 75:125] = np.inf
    assert _top(wall) is None


@pytest.mark.parametrize("sky", [slice(50, 150), slice(None)])
def test_the_sky_over_a_house_is_sky_between_higher_ones_too(sky: slice) -> None:
    wall = _front(_block(30.0))
    wall[:60, sky] = np.inf
    assert _top(wall) is not None


def test_a_row_of_which_more_is_unknown_than_open_is_no_sky() -> None:
    wall = _front(_block(30.0))
    wall[:60] = np.nan
    wall[:60, 90:104] = np.inf
    assert _top(wall) is None


def test_the_wall_at_a_row_is_measured_there_and_the_stand_off_stands_in_for_what_is_no_wall() -> None:
    depth = np.full((100, 100), 60.0, np.float32)  # houses far behind, over the roof
    depth[60:80] = 10.5
    depth[80:] = 8.0  # a balcony
    settings = FacadeParameters()
    assert wall_at_row_m(_seen(depth), 0.70, 10.0, settings) == pytest.approx(10.5)
    assert wall_at_row_m(_seen(depth), 0.30, 10.0, settings) == 10.0
    assert wall_at_row_m(_seen(depth), 0.90, 10.0, settings) == 10.0
    assert wall_at_row_m(_seen(np.full((100, 100), np.inf, np.float32)), 0.5, 10.0, settings) == 10.0


def test_the_wall_ahead_is_told_from_a_wing_that_steps_back() -> None:
    ahead = Prism(rectangle(5.0, 5.0, 10.0, 10.0), 0.0, 12.0)
    wing = Prism(rectangle(-5.0, 10.0, 10.0, 10.0), 0.0, 12.0)
    # nine metres away the wall from x = 0 to 9 fills the right half of the picture
    assert wall_columns(_seen(_front(ahead, wing)), 9.0) == pytest.approx((100, 200), abs=2)


def test_a_wall_that_fills_the_picture_is_shown_by_all_columns_and_a_post_is_no_wall() -> None:
    assert wall_columns(_seen(_front(_block(20.0))), 9.0) == (0, 200)
    post = Prism(rectangle(0.0, 0.0, 0.3, 0.3), 0.0, 20.0)
    assert wall_columns(_seen(_front(post)), 9.0) is None
