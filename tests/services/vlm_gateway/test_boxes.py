"""Box conventions, with sizes worked out by hand."""

from typing import get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.vlm_gateway.chat.boxes import BadBox, Size, scale, smart_resize, to_unit
from services.vlm_gateway.presets import BoxOrder, BoxStyle, families, servers


@pytest.mark.parametrize(
    ("size", "bounds", "expected"),
    [
        (Size(800, 800), (3136, 12_845_056), Size(812, 812)),  # 800 / 28 = 28.57 -> 29
        (Size(1000, 500), (3136, 12_845_056), Size(1008, 504)),  # 35.7 -> 36, 17.86 -> 18
        (Size(10, 10), (3136, 12_845_056), Size(56, 56)),  # too small: at least 56 x 56
        (Size(4000, 3000), (3136, 1_003_520), Size(1148, 840)),  # shrunk by 3.458: 1156 -> 1148, 867 -> 840
        (Size(800, 800), (3136, 501_760), Size(700, 700)),  # 708 -> 700
    ],
)
def test_the_qwen_processor_s_sizes(size: Size, bounds: tuple[int, int], expected: Size) -> None:
    assert smart_resize(size, 28, *bounds) == expected


@given(st.integers(28, 4096), st.integers(28, 4096))
def test_resized_pictures_are_multiples_of_the_factor_and_within_bounds(width: int, height: int) -> None:
    resized = smart_resize(Size(width, height), 28, 3136, 1_003_520)
    assert resized.width % 28 == resized.height % 28 == 0
    if max(width, height) / min(width, height) < 20:
        assert 3136 <= resized.width * resized.height <= 1_003_520


@pytest.mark.parametrize("order", get_args(BoxOrder))
@pytest.mark.parametrize("style", get_args(BoxStyle))
def test_the_whole_picture_is_the_whole_picture_in_every_convention(style: BoxStyle, order: BoxOrder) -> None:
    full = scale(style, Size(640, 480), 28, 3136, 12_845_056)
    corner = [full[1], full[0]] if order == "yxyx" else list(full)
    box = to_unit([0, 0, *corner], order, full)
    assert (box.x_min, box.y_min, box.x_max, box.y_max) == (0, 0, 1, 1)


def test_each_order_means_the_same_box() -> None:
    orders: dict[BoxOrder, list[float]] = {
        "xyxy": [100, 200, 500, 900],
        "yxyx": [200, 100, 900, 500],
        "xywh": [100, 200, 400, 700],
    }
    for order, numbers in orders.items():
        box = to_unit(numbers, order, (1000, 1000))
        assert (box.x_min, box.y_min, box.x_max, box.y_max) == pytest.approx((0.1, 0.2, 0.5, 0.9))


def test_pixels_count_in_the_picture_as_sent_and_resized_ones_in_the_resized() -> None:
    assert scale("pixels", Size(800, 600), 28, 3136, 12_845_056) == (800, 600)
    assert scale("resized_pixels", Size(800, 600), 28, 3136, 12_845_056) == (812, 588)


def test_an_edge_slightly_outside_is_moved_to_the_picture_s_edge() -> None:
    box = to_unit([-5, 0, 1010, 500], "xyxy", (1000, 1000))
    assert (box.x_min, box.x_max) == (0, 1)


@pytest.mark.parametrize(
    "numbers",
    [
        [0, 0, 1100, 500],
        [-100, 0, 500, 500],
        [500, 0, 400, 500],
        [0, 500, 400, 500],
        [0.1, 0.2, 0.5, 0.9],  # 0..1 where 0..1000 was asked for
        [0, 0, float("nan"), 1],
        [0, 0, float("inf"), 1],
        [0, 0, 500],
        [],
    ],
)
def test_numbers_that_are_no_box_are_refused(numbers: list[float]) -> None:
    with pytest.raises(BadBox):
        to_unit(numbers, "xyxy", (1000, 1000))


def test_all_presets_can_be_read_and_the_paper_s_models_are_there() -> None:
    assert {"qwen2-vl", "llama-3.2-vision", "yi-vl", "deepseek-r1-distill"} <= set(families())
    assert {"vllm", "ollama", "llama-cpp", "lm-studio", "openai"} <= set(servers())
    assert families()["llama-3.2-vision"].max_images == 1
    assert not families()["deepseek-r1-distill"].vision
