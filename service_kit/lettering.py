"""Text in pictures for people, in the fonts that OpenCV 5 brings along: Latin, Cyrillic, Greek, Chinese and more.

OpenCV reads a font (6 MB) for each thread that writes with it, and keeps it as long as the thread lives. So one thread
does all the writing.
"""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

Picture = NDArray[np.uint8]
"""(H, W, 3) uint8."""
Colour = tuple[int, int, int]

REGULAR, BOLD = 400, 700
_NO_WRAP = (0, 1 << 20)
_OUTLINE_SHARE = 0.1


def draw_text(
    picture: Picture,
    text: str,
    at: tuple[int, int],
    size_px: float,
    colour: Colour,
    *,
    weight: int = REGULAR,
    outline: Colour | None = None,
) -> None:
    """Writes one line into `picture`, its baseline beginning at `at` (x, y); what does not fit is cut off. `size_px` is
    the font's size, `outline` a colour drawn round the letters, for text on a photograph."""
    _writer().submit(_draw, picture, one_line(text), at, size_px, colour, weight, outline).result()


def text_width(text: str, size_px: float, *, weight: int = REGULAR) -> int:
    """How many pixels wide the line is."""
    return _writer().submit(_width, one_line(text), size_px, weight).result()


def wrapped(text: str, width_px: int, size_px: float) -> list[str]:
    """The text in lines of at most `width_px`, broken between words; a word that is longer has a line of its own."""
    lines = [""]
    for word in one_line(text).split():
        longer = f"{lines[-1]} {word}".strip()
        if text_width(longer, size_px) <= width_px or not lines[-1]:
            lines[-1] = longer
        else:
            lines.append(word)
    return lines


def one_line(text: str) -> str:
    """The text without what would break a line or move what is written."""
    return "".join(c if c.isprintable() else " " for c in text)


@cache
def _writer() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(1, thread_name_prefix="lettering")


@cache
def _font() -> cv2.FontFace:
    return cv2.FontFace("sans")


def _width(line: str, size_px: float, weight: int) -> int:
    x, _, width, _ = cv2.getTextSize((0, 0), line, (0, 0), _font(), _whole(size_px), weight, wrap=_NO_WRAP)
    return int(x + width)


def _draw(
    picture: Picture,
    line: str,
    at: tuple[int, int],
    size_px: float,
    colour: Colour,
    weight: int,
    outline: Colour | None,
) -> None:
    if outline is not None:
        for x, y in _around(at, max(1, round(_OUTLINE_SHARE * size_px))):
            _put(picture, line, (x, y), size_px, outline, weight)
    _put(picture, line, at, size_px, colour, weight)


def _put(picture: Picture, text: str, at: tuple[int, int], size_px: float, colour: Colour, weight: int) -> None:
    cv2.putText(picture, text, at, colour, _font(), _whole(size_px), weight, wrap=_NO_WRAP)


def _whole(size_px: float) -> int:
    return max(1, round(size_px))


def _around(at: tuple[int, int], reach: int) -> Iterator[tuple[int, int]]:
    for dx in (-reach, 0, reach):
        for dy in (-reach, 0, reach):
            yield at[0] + dx, at[1] + dy
