"""The embedded model's parts on pictures drawn here, without any fitted weights."""

import numpy as np
import pytest
from numpy.typing import NDArray

from services.vlm_gateway.embedded.bands import (
    BANDS,
    PER_SEGMENT,
    REACH,
    SEGMENTS,
    longest_run,
    peaks,
    row_bands,
    small,
)
from services.vlm_gateway.embedded.colours import BINS, MAX_PATCHES, Patch, bin_index, coded, likeness, patches
from services.vlm_gateway.embedded.describe import describe, width
from services.vlm_gateway.embedded.perceptron import Perceptron, sigmoid, softmax

RED, GREY = (200, 26, 30), (128, 128, 128)


def canvas() -> NDArray[np.uint8]:
    return np.full((800, 800, 3), GREY, np.uint8)


def red_table() -> NDArray[np.uint8]:
    table = np.zeros(BINS, np.uint8)
    table[bin_index(np.array([[RED]], np.uint8))[0, 0]] = 255
    return table


def test_patches_are_the_boxes_of_what_has_the_colour_largest_first() -> None:
    picture = canvas()
    picture[100:130, 200:220] = RED
    picture[500:560, 600:650] = RED
    found = patches(likeness(coded(picture), red_table()))
    assert found == [Patch(600, 500, 50, 60, 3000), Patch(200, 100, 20, 30, 600)]


def test_a_wall_of_the_colour_is_not_a_thing() -> None:
    picture = canvas()
    picture[:, :300] = RED
    assert patches(likeness(coded(picture), red_table())) == []


def test_many_specks_are_bounded_and_the_smallest_left_out() -> None:
    picture = canvas()
    for k in range(60):
        picture[20 + 12 * (k // 10) : 27 + 12 * (k // 10), 20 * (k % 10) : 20 * (k % 10) + 7] = RED
    picture[700:703, 700:703] = RED
    found = patches(likeness(coded(picture), red_table()))
    assert len(found) == MAX_PATCHES
    assert min(p.area for p in found) >= 49


@pytest.mark.parametrize("at", [(0, 0), (770, 780), (400, 400)])
def test_a_description_has_its_length_wherever_the_patch_lies(at: tuple[int, int]) -> None:
    y, x = at
    picture = canvas()
    picture[y : y + 30, x : x + 20] = RED
    like = likeness(coded(picture), red_table())
    rows = describe(picture, like, patches(like), 1, 10)
    assert rows.shape == (1, width(10))
    assert np.isfinite(rows).all()
    assert rows[0, -10:].tolist() == [0, 1, 0, 0, 0, 0, 0, 0, 0, 0]


def test_the_same_thing_twice_as_large_is_described_alike() -> None:
    rows = []
    for k in (1, 2):
        picture = canvas()
        picture[300 : 300 + 40 * k, 300 : 300 + 24 * k] = RED
        picture[300 : 300 + 20 * k, 300 : 300 + 8 * k] = (250, 240, 220)
        like = likeness(coded(picture), red_table())
        rows.append(describe(picture, like, patches(like), 0, 1)[0, :400])
    assert np.dot(rows[0], rows[1]) / np.linalg.norm(rows[0]) / np.linalg.norm(rows[1]) > 0.9


def test_bands_tell_window_rows_from_the_wall_between() -> None:
    picture = canvas()
    for x in range(20, 780, 60):
        picture[200:300, x : x + 30] = (40, 50, 60)
    bands = row_bands(small(picture))
    assert bands.shape[0] == BANDS
    upright = bands[:, REACH // 2 * SEGMENTS * PER_SEGMENT + 4]  # its own first segment, among its surroundings
    assert upright[int(0.31 * BANDS)] > 10 * max(float(upright[int(0.1 * BANDS)]), 1e-4)


def test_peaks_keep_their_distance_and_runs_bridge_small_gaps() -> None:
    heat = np.zeros(30, np.float32)
    heat[[3, 5, 12, 20]] = (0.9, 0.8, 0.6, 0.2)
    assert peaks(heat, 0.5, 4) == [3, 12]
    inside = np.zeros(30, bool)
    inside[[2, 3, 4, 7, 8]] = True
    inside[20:24] = True
    assert longest_run(inside) == (2, 9)
    assert longest_run(np.zeros(5, bool)) is None


def test_a_perceptron_survives_packing_and_its_outputs_are_shares() -> None:
    rng = np.random.default_rng(1)
    whole = Perceptron(*(rng.normal(0, 1, s).astype(np.float32) for s in ((5,), (5,), (5, 4), (4,), (4, 3), (3,))))
    back = Perceptron.unpacked("p", whole.packed("p"))
    x = rng.normal(0, 1, (7, 5)).astype(np.float32)
    np.testing.assert_allclose(back.logits(x), whole.logits(x), rtol=0.02, atol=0.05)
    np.testing.assert_allclose(softmax(whole.logits(x)).sum(axis=1), 1.0, rtol=1e-5)
    assert ((sigmoid(whole.logits(x)) > 0) & (sigmoid(whole.logits(x)) < 1)).all()
