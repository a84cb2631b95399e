"""Depth drawn for people: colours that can be told apart, and a picture small enough to keep with every look."""

from itertools import pairwise

import cv2
import numpy as np

from contracts.images import INVALID, NO_RETURN
from mission.depth_pictures import EDGE_PX, depth_picture

UNIT_M = 0.002


def drawn(metres: float | None, *, units: int = INVALID, size: int = 800) -> tuple[int, int, int]:
    """The colour (blue, green, red) of a wall at that distance, or of `units`."""
    wall = np.full((size, size), units if metres is None else round(metres / UNIT_M), np.uint16)
    shown = cv2.imdecode(np.frombuffer(depth_picture(wall, UNIT_M), np.uint8), cv2.IMREAD_COLOR)
    return tuple(int(value) for value in np.median(shown.reshape(-1, 3), axis=0))  # type: ignore[return-value]


def test_what_is_near_is_lighter_than_what_is_far() -> None:
    light = [sum(drawn(metres)) for metres in (0.6, 2.0, 6.0, 15.0, 39.0)]
    assert light == sorted(light, reverse=True)
    assert min(a - b for a, b in pairwise(light)) > 20


def test_beyond_the_colours_ends_it_is_as_at_them() -> None:
    assert drawn(0.1) == drawn(0.5)
    assert drawn(100.0) == drawn(40.0)


def test_what_is_unknown_and_what_is_out_of_reach_have_colours_of_their_own() -> None:
    assert max(drawn(None, units=INVALID)) < 10
    assert min(drawn(None, units=NO_RETURN)) > 245


def test_a_picture_is_no_larger_than_it_is_looked_at() -> None:
    jpeg = depth_picture(np.arange(800 * 600, dtype=np.uint32).reshape(600, 800).astype(np.uint16), UNIT_M)
    shown = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
    assert max(shown.shape[:2]) <= EDGE_PX
    assert shown.shape[1] > shown.shape[0]
