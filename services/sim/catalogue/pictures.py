"""The pictures on the posters: bold flat shapes, drawn by rule on a field of the named colour.

Coordinates run 0..1 to the right and 0..1.33 downwards, as on a sheet three wide and four high.
"""

from collections.abc import Callable, Sequence
from math import cos, pi, sin

import cv2
import numpy as np
from numpy.typing import NDArray

from services.sim.catalogue.palette import COLOURS, CREAM, GOLD, INK
from services.sim.geometry.mesh import Colour, mixed, rgb

Picture = NDArray[np.uint8]
WIDTH, HEIGHT = 240, 320
_FINER = 4


class Sheet:
    """A sheet to draw on, four times finer than what leaves it."""

    def __init__(self, colour: str) -> None:
        self.colour = colour
        self.pixels = np.empty((HEIGHT * _FINER, WIDTH * _FINER, 3), np.uint8)
        self.pixels[:] = rgb(COLOURS[colour])
        self._unit = WIDTH * _FINER

    def fill(self, points: Sequence[tuple[float, float]], colour: Colour) -> None:
        corners = np.rint(np.array(points) * self._unit).astype(np.int32)
        cv2.fillPoly(self.pixels, [corners], rgb(colour).tolist())

    def disc(self, x: float, y: float, r: float, colour: Colour, ry: float | None = None, turn: float = 0.0) -> None:
        a = np.linspace(0, 2 * pi, 48, endpoint=False)
        dx, dy = r * np.cos(a), (r if ry is None else ry) * np.sin(a)
        c, s = cos(turn), sin(turn)
        self.fill(list(zip((x + c * dx - s * dy).tolist(), (y + s * dx + c * dy).tolist(), strict=True)), colour)

    def line(self, points: Sequence[tuple[float, float]], width: float, colour: Colour) -> None:
        corners = np.rint(np.array(points) * self._unit).astype(np.int32)
        cv2.polylines(
            self.pixels, [corners], False, rgb(colour).tolist(), max(1, round(width * self._unit)), cv2.LINE_8
        )

    def tone(self, *choices: tuple[Colour, tuple[str, ...]]) -> Colour:
        """The first of the colours whose listed grounds don't include this sheet's."""
        for colour, grounds in choices:
            if self.colour not in grounds:
                return colour
        return INK

    def finished(self) -> Picture:
        """(HEIGHT, WIDTH, 3) with a thin pale border."""
        edge = round(0.035 * self._unit)
        rim = rgb("#3a3b40" if self.colour == "white" else "#f7f5ee").tolist()
        cv2.rectangle(self.pixels, (0, 0), (self.pixels.shape[1] - 1, self.pixels.shape[0] - 1), rim, 2 * edge)
        return np.asarray(cv2.resize(self.pixels, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA), np.uint8)


def cat(s: Sheet) -> None:
    fur = s.tone((INK, ("black",)), (CREAM, ()))
    eye = s.tone(("#f8d21c", ("yellow",)), ("#7bd13f", ()))
    s.disc(0.5, 0.98, 0.23, fur, 0.27)
    s.line([(0.68, 1.18), (0.84, 1.12), (0.86, 0.95), (0.8, 0.84)], 0.065, fur)
    s.disc(0.5, 0.53, 0.25, fur, 0.215)
    for k in (-1, 1):
        s.fill([(0.5 + k * 0.245, 0.5), (0.5 + k * 0.24, 0.2), (0.5 + k * 0.05, 0.36)], fur)
        s.disc(0.5 + k * 0.1, 0.5, 0.06, eye, 0.05)
        s.disc(0.5 + k * 0.1, 0.5, 0.017, "#101012", 0.045)
        whisker = "#ffffff" if fur == INK else INK
        for dy in (-0.02, 0.04):
            s.line([(0.5 + k * 0.06, 0.62 + dy / 2), (0.5 + k * 0.32, 0.61 + dy * 2)], 0.009, whisker)
        s.disc(0.5 + k * 0.1, 1.2, 0.085, fur, 0.06)
    s.fill([(0.465, 0.575), (0.535, 0.575), (0.5, 0.615)], "#f28fb1")


def tree(s: Sheet) -> None:
    crown = s.tone(
        ("#1f7d34", ("green", "blue", "black", "brown", "purple", "red")), ("#f3f0dc", ("white",)), (INK, ())
    )
    trunk = s.tone(
        ("#6a3d1c", ("brown", "red", "black", "purple", "green", "blue")), ("#3a2413", ("black",)), ("#c9a36d", ())
    )
    s.fill([(0.44, 1.22), (0.46, 0.8), (0.54, 0.8), (0.56, 1.22)], trunk)
    s.line([(0.5, 0.95), (0.36, 0.72)], 0.045, trunk)
    s.line([(0.5, 0.9), (0.64, 0.68)], 0.045, trunk)
    for x, y, r in ((0.5, 0.38, 0.2), (0.32, 0.52, 0.16), (0.68, 0.52, 0.16), (0.41, 0.62, 0.14), (0.6, 0.62, 0.14)):
        s.disc(x, y, r, crown)
    for x, y in ((0.4, 0.36), (0.58, 0.42), (0.3, 0.55), (0.5, 0.58), (0.69, 0.57)):
        s.disc(x, y, 0.028, s.tone(("#e2362c", ("red", "purple", "brown")), (GOLD, ())))
    s.line([(0.2, 1.22), (0.8, 1.22)], 0.03, trunk)


def sailing_boat(s: Sheet) -> None:
    sail = s.tone(("#ffffff", ("white",)), ("#e2362c", ()))
    hull = s.tone(("#5c2f14", ("brown", "black", "purple", "blue", "red")), (CREAM, ()))
    s.line([(0.5, 0.16), (0.5, 0.96)], 0.026, s.tone((INK, ("black",)), (CREAM, ())))
    s.fill([(0.53, 0.2), (0.53, 0.86), (0.87, 0.86)], sail)
    s.fill([(0.47, 0.3), (0.47, 0.86), (0.2, 0.86)], sail)
    s.fill([(0.14, 0.93), (0.88, 0.93), (0.76, 1.12), (0.26, 1.12)], hull)
    wave = s.tone(("#bfe4f7", ("white",)), ("#2f7fd6", ()))
    s.line([(0.08 + 0.02 * i, 1.18 + 0.022 * sin(i * 0.75)) for i in range(43)], 0.03, wave)
    s.fill(
        [(0.5, 0.13), (0.5, 0.21), (0.62, 0.17)],
        s.tone(("#e2362c", ("red", "pink", "orange")), (GOLD, ("yellow",)), (INK, ())),
    )


def guitar(s: Sheet) -> None:
    body = s.tone(("#c9803a", ("orange", "brown", "red", "yellow", "purple")), ("#f4e3bd", ()))
    if s.colour == "yellow":
        body = "#8a4a1c"
    dark = "#241a14" if s.colour != "black" else "#6a4526"
    c, t = cos(0.42), sin(0.42)

    def at(x: float, y: float) -> tuple[float, float]:
        return 0.46 + c * x - t * y, 0.72 + t * x + c * y

    for x, y, r in ((0.0, 0.2, 0.235), (0.0, -0.06, 0.175), (0.0, 0.06, 0.15)):
        s.disc(*at(x, y), r, dark)
    for x, y, r in ((0.0, 0.2, 0.21), (0.0, -0.06, 0.15), (0.0, 0.06, 0.13)):
        s.disc(*at(x, y), r, body)
    s.disc(*at(0, 0.03), 0.07, dark)
    s.fill([at(-0.032, 0.0), at(0.032, 0.0), at(0.026, -0.5), at(-0.026, -0.5)], dark)
    s.fill([at(-0.055, -0.48), at(0.055, -0.48), at(0.065, -0.66), at(-0.065, -0.66)], dark)
    for y in (-0.52, -0.57, -0.62):
        for k in (-1, 1):
            s.disc(*at(k * 0.085, y), 0.018, s.tone(("#ffffff", ("white",)), (INK, ())))
    s.line([at(-0.09, 0.25), at(0.09, 0.25)], 0.03, dark)
    for k in (-1, 0, 1):
        s.line([at(k * 0.014, 0.24), at(k * 0.011, -0.5)], 0.005, "#f3efe2")


def mountain(s: Sheet) -> None:
    rock = s.tone(("#3b4350", ("black", "blue", "purple", "brown")), ("#aab3bf", ()))
    rock2 = mixed(rock, "#000000", 0.25)
    snow = s.tone(("#ffffff", ("white",)), ("#cfe6f5", ()))
    s.disc(0.74, 0.3, 0.11, s.tone((GOLD, ("yellow", "orange")), ("#e8432e", ("red",)), (CREAM, ())))
    s.fill([(0.42, 1.2), (0.92, 1.2), (0.7, 0.72)], rock2)
    s.fill([(0.06, 1.2), (0.74, 1.2), (0.4, 0.42)], rock)
    s.fill([(0.4, 0.42), (0.276, 0.705), (0.33, 0.66), (0.385, 0.73), (0.44, 0.665), (0.49, 0.72), (0.525, 0.71)], snow)
    s.fill([(0.7, 0.72), (0.63, 0.875), (0.69, 0.845), (0.735, 0.89), (0.775, 0.885)], snow)


def heart(s: Sheet) -> None:
    a = np.linspace(0, 2 * pi, 120)
    x = 16 * np.sin(a) ** 3
    y = 13 * np.cos(a) - 5 * np.cos(2 * a) - 2 * np.cos(3 * a) - np.cos(4 * a)
    colour = s.tone(("#e01f2d", ("red", "pink", "orange", "purple", "brown")), ("#ffffff", ()))
    s.fill(list(zip((0.5 + x * 0.0215).tolist(), (0.66 - y * 0.0225).tolist(), strict=True)), colour)
    s.disc(0.34, 0.5, 0.05, mixed(colour, "#ffffff", 0.6) if colour != "#ffffff" else "#ffd5de", 0.075, turn=0.5)


def rocket(s: Sheet) -> None:
    hull = s.tone(("#f8f8f4", ("white",)), ("#3a6fd0", ()))
    red = s.tone(("#e2362c", ("red", "pink", "orange", "purple")), (GOLD, ("yellow",)), (INK, ()))
    s.fill(
        [(0.4, 0.95), (0.6, 0.95), (0.5, 1.24)],
        s.tone(("#f6a21b", ("orange", "yellow")), ("#f4efe0", ("white",)), (INK, ())),
    )
    for k in (-1, 1):
        s.fill([(0.5 + k * 0.13, 0.66), (0.5 + k * 0.28, 0.86), (0.5 + k * 0.28, 1.02), (0.5 + k * 0.13, 0.92)], red)
    side = [(0.5 + 0.16 * sin(pi * (0.12 + 0.76 * t)) ** 0.8, 0.28 + 0.68 * t) for t in np.linspace(0, 1, 20)]
    s.fill([*side, *[(1 - x, y) for x, y in reversed(side)]], hull)
    s.fill([(0.5, 0.13), *[p for p in side if p[1] < 0.44], *[(1 - x, y) for x, y in reversed(side) if y < 0.44]], red)
    s.disc(0.5, 0.58, 0.085, INK)
    s.disc(0.5, 0.58, 0.06, "#8fd0f2")
    for x, y, r in ((0.2, 0.3, 0.03), (0.82, 0.42, 0.026), (0.16, 0.62, 0.02), (0.83, 0.2, 0.02), (0.84, 0.72, 0.02)):
        s.disc(x, y, r, s.tone(("#fff6c8", ("white", "yellow")), (INK, ())))


def drawn(draw: Callable[[Sheet], None], colour: str) -> Picture:
    """One picture on a ground of the named colour, (HEIGHT, WIDTH, 3) sRGB."""
    sheet = Sheet(colour)
    draw(sheet)
    return sheet.finished()
