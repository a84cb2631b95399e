"""Text in pictures: the letters of those who order, where they were asked for."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from service_kit.lettering import draw_text, text_width, wrapped

INK = (0, 0, 0)


def drawn(text: str, size_px: int = 32, width: int = 600) -> NDArray[np.bool_]:
    """Where `text` leaves ink on a white sheet; its baseline at row 60, from column 20."""
    sheet = np.full((90, width, 3), 255, np.uint8)
    draw_text(sheet, text, (20, 60), size_px, INK)
    return np.asarray(sheet.min(axis=2) < 128)


@pytest.mark.parametrize("letter", "äöüßÄÖÜéèñçøåæłšžőığЖЁщΩώ四楼花窓의ẵđ°–’“")
def test_a_customer_s_letter_is_drawn_as_itself(letter: str) -> None:
    ink = drawn(letter)
    assert ink.any()
    assert (ink != drawn("?")).any()


def test_an_umlaut_has_its_dots() -> None:
    plain, dotted = drawn("u"), drawn("ü")
    top = int(np.nonzero(plain.any(axis=1))[0][0])
    assert dotted[: top - 1].any()
    assert not plain[: top - 1].any()


def test_a_line_is_as_wide_as_it_is_said_to_be() -> None:
    text = "Grüße an den 4. Stock"
    columns = np.nonzero(drawn(text).any(axis=0))[0]
    assert columns[-1] + 1 - 20 == pytest.approx(text_width(text, 32), abs=3)
    assert text_width("", 32) == 0


def test_what_does_not_fit_is_cut_off_and_nothing_is_written_below() -> None:
    ink = drawn("überall " * 20, width=200)
    assert ink[:, -20:].any()
    assert not ink[75:].any()


def test_a_line_break_in_the_text_is_a_space() -> None:
    assert (drawn("rot\nblau\tgrün") == drawn("rot blau grün")).all()


def test_lines_are_broken_between_words_and_keep_all_of_them() -> None:
    text = "Bitte zum vierten Stock, zum Fenster mit dem grünen Blumentopf"
    lines = wrapped(text, 220, 20)
    assert " ".join(lines) == text
    assert len(lines) > 1
    assert all(text_width(line, 20) <= 220 for line in lines)
    assert wrapped("Donaudampfschifffahrtsgesellschaft", 50, 20) == ["Donaudampfschifffahrtsgesellschaft"]


def test_an_outline_makes_text_readable_on_anything() -> None:
    sheet = np.full((90, 300, 3), 255, np.uint8)
    draw_text(sheet, "weiß", (20, 60), 32, (255, 255, 255), outline=INK)
    assert (sheet.min(axis=2) < 128).any()


def test_threads_that_write_share_the_fonts() -> None:
    def resident_mb() -> float:
        return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 1e6

    drawn("warm")
    threads = [ThreadPoolExecutor(1) for _ in range(8)]
    before = resident_mb()
    try:
        for thread in threads:
            thread.submit(drawn, "Grüße").result()
        assert resident_mb() - before < 12, "each thread that has fonts of its own takes 6 MB"
    finally:
        for thread in threads:
            thread.shutdown()
