"""Eq. 4-6 by hand, and the mirror law."""

from collections.abc import Mapping
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navigation.viewpoint import Choice, Sliced, ViewpointParameters, choose_view, row_range, score_view, slice_means
from tests.navigation import usual

FOUR = usual.VIEWPOINT._replace(slices=4, delta_m=5.0, d_max_m=25.0, max_over=1)
NO_CHANCE = np.random.default_rng(0)


def _chosen(
    means: Mapping[int, list[float]],
    settings: ViewpointParameters,
    d_max_m: float | None,
    generator: np.random.Generator,
) -> Choice:
    """Of views named by their headings."""
    views = {str(heading): Sliced(heading, values) for heading, values in means.items()}
    return choose_view(views, settings, d_max_m, generator)


def _uniform(*columns: int, height: int = 3) -> np.ndarray:
    return np.tile(np.array(columns, np.uint16), (height, 1))


def test_slice_means_are_the_means_of_equal_widths() -> None:
    units = np.array([[10, 20, 30, 40], [30, 40, 50, 60]], np.uint16)
    np.testing.assert_allclose(slice_means(units, 0.1, 2, 60.0), [2.5, 4.5])


def test_no_return_counts_as_the_sensor_range_before_the_mean() -> None:
    units = _uniform(65535, 100, 65535, 65535)
    np.testing.assert_allclose(slice_means(units, 0.1, 2, 60.0), [(60.0 + 10.0) / 2, 60.0])


def test_depth_beyond_the_sensor_range_counts_as_the_range() -> None:
    np.testing.assert_allclose(slice_means(_uniform(900, 100), 0.1, 2, 60.0), [60.0, 10.0])


def test_invalid_pixels_are_left_out_and_an_invalid_slice_is_nan() -> None:
    units = np.array([[0, 200, 0, 0], [100, 0, 0, 0]], np.uint16)
    means = slice_means(units, 0.1, 2, 60.0)
    assert means[0] == pytest.approx(15.0)
    assert np.isnan(means[1])


def test_only_the_boxs_rows_count() -> None:
    units = np.array([[500], [100], [200], [500]], np.uint16)
    assert row_range(0.25, 0.75, 4) == (1, 3)
    np.testing.assert_allclose(slice_means(units, 0.1, 1, 60.0, (1, 3)), [15.0])


@pytest.mark.parametrize(
    ("y_min", "y_max", "rows"), [(0.0, 1.0, (0, 10)), (0.99, 1.0, (9, 10)), (0.5, 0.501, (5, 6)), (0.12, 0.31, (1, 4))]
)
def test_a_boxs_rows_are_those_it_touches_and_never_none(y_min: float, y_max: float, rows: tuple[int, int]) -> None:
    assert row_range(y_min, y_max, 10) == rows


def test_a_width_that_does_not_divide_is_cut_at_whole_columns() -> None:
    means = slice_means(_uniform(10, 10, 20, 30, 30), 1.0, 2, 60.0)
    np.testing.assert_allclose(means, [10.0, 80.0 / 3])  # the border 2.5 rounds to 2


def test_fewer_columns_than_slices_are_refused() -> None:
    with pytest.raises(ValueError, match="3 columns can't be cut into 4"):
        slice_means(_uniform(1, 2, 3), 1.0, 4, 60.0)


@given(st.integers(1, 300), st.integers(4, 60), st.integers(0, 2**32 - 1))
def test_slice_means_equal_a_plain_computation(height: int, width: int, seed: int) -> None:
    units = np.random.default_rng(seed).choice(np.array([0, 1, 7000, 29999, 30001, 65535], np.uint16), (height, width))
    metres = np.where(units == 0, np.nan, np.minimum(units * 0.002, 60.0))
    borders = np.rint(np.arange(5) * width / 4).astype(int)
    parts = [metres[:, a:b] for a, b in pairwise(borders)]
    expected = [np.nan if np.isnan(part).all() else np.nanmean(part) for part in parts]
    np.testing.assert_allclose(slice_means(units, 0.002, 4, 60.0), expected, rtol=1e-9)


def test_eq4_takes_a_difference_of_exactly_delta() -> None:
    splits = score_view([15.0, 10.0, 10.0, 10.0], FOUR, 25.0).splits
    assert splits[0].difference_m == 5.0
    assert splits[0].valid
    assert not score_view([14.999, 10.0, 10.0, 10.0], FOUR, 25.0).splits[0].valid


def test_eq4_wants_the_open_side_on_the_left() -> None:
    assert score_view([10.0, 10.0, 40.0, 40.0], FOUR, 60.0).best is None


def test_eq5_by_hand() -> None:
    """Means 60 50 10 12. j = 1: 0 + (26^2 + 14^2 + 12^2) = 1016; j = 2: 2 x 5^2 + 2 x 1^2 = 52; j = 3: 1400 + 0."""
    score = score_view([60.0, 50.0, 10.0, 12.0], FOUR, 25.0)
    assert [split.j for split in score.splits] == [1, 2, 3]
    assert [split.difference_m for split in score.splits] == pytest.approx([36.0, 44.0, 28.0])
    assert [split.variance_m2 for split in score.splits] == pytest.approx([1016.0, 52.0, 1400.0])
    assert [split.over for split in score.splits] == [1, 0, 0]
    assert score.best == score.splits[1]


def test_too_many_facade_slices_beyond_d_max_make_a_split_invalid() -> None:
    settings = FOUR._replace(max_over=1)
    assert score_view([60.0, 30.0, 28.0, 10.0], settings, 25.0).splits[0].over == 2
    assert not score_view([60.0, 30.0, 28.0, 10.0], settings, 25.0).splits[0].valid
    assert score_view([60.0, 30.0, 28.0, 10.0], settings, 29.0).splits[0].valid


def test_of_equal_variances_the_larger_j_wins() -> None:
    score = score_view([20.0, 10.0, 0.0], FOUR._replace(slices=3), 25.0)
    assert [split.variance_m2 for split in score.splits] == [50.0, 50.0]
    assert score.best is not None
    assert score.best.j == 2


def test_nan_means_are_left_out_and_an_empty_part_is_no_split() -> None:
    score = score_view([np.nan, 60.0, 10.0, 10.0], FOUR, 25.0)
    assert not score.splits[0].valid
    assert score.best is not None
    assert score.best.j == 2
    assert score.splits[1].difference_m == 50.0
    assert score_view([np.nan] * 4, FOUR, 25.0).best is None


def test_eq6_takes_the_view_with_the_largest_j() -> None:
    means = {0: [60.0, 10.0, 10.0, 10.0], 45: [60.0, 60.0, 60.0, 10.0], 90: [10.0, 10.0, 10.0, 10.0]}
    choice = _chosen(means, FOUR, None, NO_CHANCE)
    assert (choice.heading_deg, choice.reason) == (45, "split")
    assert choice.scores["45"].best is not None
    assert choice.scores["45"].best.j == 3


def test_equal_j_goes_to_the_cleaner_split_then_to_the_buildings_side() -> None:
    clean, rough = [60.0, 60.0, 10.0, 10.0], [60.0, 58.0, 10.0, 10.0]
    assert _chosen({-45: clean, 45: rough}, FOUR, None, NO_CHANCE).heading_deg == -45
    assert _chosen({-45: clean, 45: clean}, FOUR, None, NO_CHANCE).heading_deg == 45
    counter = FOUR._replace(direction="counterclockwise")
    mirrored = {-45: clean[::-1], 45: clean[::-1]}
    assert _chosen(mirrored, counter, None, NO_CHANCE).heading_deg == -45


def test_without_a_split_the_right_view_is_taken_and_d_max_rises_to_its_bound_and_falls_back() -> None:
    settings = FOUR._replace(d_max_m=25.0, d_max_step_m=20.0, d_max_limit_m=60.0)
    flat = {h: [30.0] * 4 for h in (-90, -45, 0, 45, 90)}
    first = _chosen(flat, settings, None, NO_CHANCE)
    assert (first.heading_deg, first.reason, first.d_max_m, first.d_max_next_m) == (90, "no_split", 25.0, 45.0)
    second = _chosen(flat, settings, first.d_max_next_m, NO_CHANCE)
    assert (second.d_max_m, second.d_max_next_m) == (45.0, 60.0)
    assert _chosen(flat, settings, 60.0, NO_CHANCE).d_max_next_m == 60.0
    found = _chosen({0: [60.0, 60.0, 30.0, 30.0]}, settings, 45.0, NO_CHANCE)
    assert (found.reason, found.d_max_m, found.d_max_next_m) == ("split", 45.0, 25.0)


def test_counter_clockwise_defaults_to_the_left_view() -> None:
    settings = FOUR._replace(direction="counterclockwise")
    assert _chosen({h: [30.0] * 4 for h in (-90, 0, 90)}, settings, None, NO_CHANCE).heading_deg == -90


def test_the_ablations_take_the_side_view_or_a_drawn_one() -> None:
    means = {h: [60.0, 60.0, 10.0, 10.0] for h in (-90, -45, 0, 45, 90)}
    default = _chosen(means, FOUR._replace(policy="default"), 35.0, NO_CHANCE)
    assert (default.heading_deg, default.reason, default.d_max_next_m) == (90, "default", 35.0)
    drawn = [
        _chosen(means, FOUR._replace(policy="random"), None, np.random.default_rng(seed)).heading_deg
        for seed in range(40)
    ]
    assert set(drawn) == set(means)
    again = _chosen(means, FOUR._replace(policy="random"), None, np.random.default_rng(7)).heading_deg
    assert again == drawn[7]


def test_no_views_are_refused() -> None:
    with pytest.raises(ValueError, match="at least one view"):
        _chosen({}, FOUR, None, NO_CHANCE)


_MEANS = st.lists(st.floats(0.5, 60.0).map(lambda m: round(m, 3)) | st.just(float("nan")), min_size=20, max_size=20)


@given(st.dictionaries(st.sampled_from((-90, -45, 0, 45, 90)), _MEANS, min_size=1), st.sampled_from((15.0, 25.0, 60.0)))
def test_mirrored_pictures_and_direction_give_the_mirrored_answer(means: dict[int, list[float]], d_max: float) -> None:
    clockwise = _chosen(means, usual.VIEWPOINT, d_max, NO_CHANCE)
    mirrored_means = {-heading: values[::-1] for heading, values in means.items()}
    mirrored = _chosen(mirrored_means, usual.VIEWPOINT._replace(direction="counterclockwise"), d_max, NO_CHANCE)
    assert mirrored.heading_deg == -clockwise.heading_deg
    assert (mirrored.reason, mirrored.d_max_next_m) == (clockwise.reason, clockwise.d_max_next_m)
    for heading in means:
        assert mirrored.scores[str(-heading)] == clockwise.scores[str(heading)]


@given(_MEANS)
def test_the_chosen_split_keeps_every_condition_and_none_is_better(values: list[float]) -> None:
    settings = usual.VIEWPOINT
    score = score_view(values, settings, 25.0)
    means = np.array(values)
    variances = []
    for split in score.splits:
        left, right = means[: split.j], means[split.j :]
        left, right = left[~np.isnan(left)], right[~np.isnan(right)]
        allowed = (
            len(left) > 0
            and len(right) > 0
            and left.mean() - right.mean() >= settings.delta_m + 1e-9
            and (right > 25.0).sum() <= settings.max_over
        )
        if allowed:
            assert split.valid
            variances.append(left.var() * len(left) + right.var() * len(right))
    if variances:
        assert score.best is not None
        assert score.best.variance_m2 <= min(variances) + 1e-6
