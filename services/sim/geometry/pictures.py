"""The pictures that fill whole surfaces (uv 0..1): window panes with what is behind them, lattices, doors, a road.

They are seen from outside: the room behind is dark, the upper half of the glass mirrors the sky.
"""

import numpy as np

from services.sim.geometry.patterns import Floats, Pattern, Picture, grid, noise, picture


def _glass(size: int, seed: int, dark: float = 0.10) -> Floats:
    """(size, size, 3): a dark room, with the sky's reflection on top and a slanting gleam."""
    x, y = grid(size)
    room = dark + 0.03 * noise(size, 4, seed, 2) + 0.05 * np.clip(y - 0.55, 0, 1)
    mirror = np.clip(0.36 - 0.42 * y + 0.05 * noise(size, 4, seed + 1, 3), 0, 1)
    gleam = 0.07 * (np.abs((x + 0.55 * y) % 1.0 - 0.42) < 0.09) * np.clip(1.1 - y, 0, 1)
    light = mirror + gleam
    glass = room[..., None] * np.array([1.0, 1.02, 1.05]) + light[..., None] * np.array([0.80, 0.95, 1.12])
    return np.asarray(glass, np.float64)


def _folds(size: int, count: float, seed: int) -> Floats:
    x, y = grid(size)
    wave = np.sin(2 * np.pi * (x * count + 0.12 * noise(size, 4, seed, 2)))
    return np.asarray(0.80 + 0.13 * wave - 0.10 * y)


def _curtains(size: int, seed: int, cloth: tuple[float, float, float], open_share: float, slant: float) -> Picture:
    """Two curtains drawn aside, leaving `open_share` of the width at the top and `slant` more below."""
    x, y = grid(size)
    rgb = _glass(size, seed)
    half = (open_share + slant * y**2) / 2
    cover = np.abs(x - 0.5) > half
    hang = _folds(size, 9, seed)[..., None] * np.array(cloth)
    through = 0.86 * hang + 0.30 * rgb
    edge = np.clip((np.abs(x - 0.5) - half) * 30, 0, 1)[..., None]
    return picture(np.where(cover[..., None], through * (0.7 + 0.3 * edge), rgb))


def _blind(size: int, seed: int, down: float, slats: int, cloth: tuple[float, float, float]) -> Picture:
    """A blind let down over `down` of the height; 0 slats: one piece of cloth."""
    _, y = grid(size)
    rgb = _glass(size, seed)
    shade = 0.86 + 0.02 * noise(size, 4, seed, 2)
    if slats:
        shade = shade * np.where(y * slats % 1 > 0.72, 0.62, 1.0)
    cloth_rgb = shade[..., None] * np.array(cloth)
    lath = (y > down - 0.025) & (y <= down)
    cloth_rgb = np.where(lath[..., None], cloth_rgb * 0.7, cloth_rgb)
    under = np.where((y > down) & (y < down + 0.04), 0.75, 1.0)[..., None]
    return picture(np.where((y <= down)[..., None], 0.92 * cloth_rgb + 0.12 * rgb, rgb * under))


def _lit(size: int) -> Picture:
    x, y = grid(size)
    glow = np.exp(-(((x - 0.35) / 0.35) ** 2 + ((y - 0.45) / 0.45) ** 2))
    return picture(_glass(size, 61, 0.12) * 0.8 + glow[..., None] * np.array([0.38, 0.27, 0.13]))


def _lattice(size: int, across: int, down: int, paper: tuple[float, float, float]) -> Picture:
    """A wooden lattice over paper: white bars to be tinted would tint the paper too, so both have their colours."""
    x, y = grid(size)
    bar = 0.13
    fx, fy = x * across % 1, y * down % 1
    wood = (fx < bar) | (fx > 1 - bar) | (fy < bar) | (fy > 1 - bar)
    light = (0.92 - 0.22 * y + 0.04 * noise(size, 8, 63, 3))[..., None] * np.array(paper)
    shade = np.where((fx < bar + 0.06) | (fy < bar + 0.08), 0.80, 1.0)[..., None]
    dark = (0.30 + 0.05 * noise(size, 16, 65, 2))[..., None] * np.array([1.0, 0.66, 0.46])
    return picture(np.where(wood[..., None], dark, light * shade))


def _door(size: int, glazed: bool) -> Picture:
    """One leaf, near white, to be tinted; panes stay dark."""
    x, y = grid(size)
    rgb = (0.90 + 0.06 * noise(size, 32, 67, 2, cells_y=4))[..., None] * np.ones(3)
    for top, bottom in ((0.07, 0.50), (0.58, 0.92)):
        inner = (np.abs(x - 0.5) < 0.34) & (y > top) & (y < bottom)
        rim = inner & ~((np.abs(x - 0.5) < 0.31) & (y > top + 0.015) & (y < bottom - 0.015))
        if glazed and top < 0.5:
            rgb = np.where(inner[..., None], _glass(size, 69), rgb)
        rgb = np.where(rim[..., None], rgb * 0.6, rgb)
    handle = np.hypot((x - 0.86) * 1.0, (y - 0.54) * 2) < 0.03
    return picture(np.where(handle[..., None], np.array([0.35, 0.33, 0.30]), rgb))


def _road(size: int) -> Picture:
    """One carriageway across u, 8 m of it along v: edge lines and a broken middle line."""
    x, y = grid(size)
    rgb = (0.37 + 0.03 * noise(size, 8, 71, 4) + 0.04 * noise(size, 256, 72))[..., None] * np.array([0.98, 1.0, 1.03])
    tracks = 0.96 + 0.04 * np.cos(4 * np.pi * (x - 0.25))
    rgb = rgb * tracks[..., None]
    line = (np.abs(x - 0.5) < 0.011) & (np.abs(y - 0.5) < 0.25)
    line |= np.abs(np.abs(x - 0.5) - 0.462) < 0.009
    return picture(np.where(line[..., None], 0.86 + 0.05 * noise(size, 64, 73)[..., None], rgb))


def _dark(seed: int, dark: float) -> Pattern:
    return Pattern(lambda size: picture(_glass(size, seed, dark)), 1.0)


def _hung(seed: int, cloth: tuple[float, float, float], open_share: float, slant: float) -> Pattern:
    return Pattern(lambda size: _curtains(size, seed, cloth, open_share, slant), 1.0)


def _shut(seed: int, down: float, slats: int, cloth: tuple[float, float, float]) -> Pattern:
    return Pattern(lambda size: _blind(size, seed, down, slats, cloth), 1.0)


BARE_PANES: dict[str, Pattern] = {
    "pane_dark": _dark(40, 0.09),
    "pane_dim": _dark(42, 0.15),
    "pane_room": Pattern(_lit, 1.0),
}
DRESSED_PANES: dict[str, Pattern] = {
    "pane_white_open": _hung(44, (0.93, 0.93, 0.92), 0.42, 0.30),
    "pane_white_shut": _hung(46, (0.88, 0.89, 0.90), 0.0, 0.10),
    "pane_cream": _hung(48, (0.92, 0.86, 0.74), 0.50, 0.10),
    "pane_warm": _hung(50, (0.74, 0.62, 0.52), 0.56, 0.05),
    "pane_grey": _hung(52, (0.62, 0.66, 0.70), 0.48, 0.20),
    "pane_net": _hung(54, (0.78, 0.80, 0.82), 0.02, 0.0),
    "pane_slats": _shut(56, 0.62, 16, (0.90, 0.90, 0.88)),
    "pane_slats_shut": _shut(58, 0.97, 24, (0.86, 0.86, 0.84)),
    "pane_roller": _shut(60, 0.36, 0, (0.90, 0.86, 0.76)),
}
LATTICES: dict[str, Pattern] = {
    "lattice_fine": Pattern(lambda size: _lattice(size, 6, 7, (0.95, 0.88, 0.72)), 1.0),
    "lattice_wide": Pattern(lambda size: _lattice(size, 4, 5, (0.93, 0.84, 0.66)), 1.0),
}
PICTURES: dict[str, Pattern] = {
    **BARE_PANES,
    **DRESSED_PANES,
    **LATTICES,
    "door": Pattern(lambda size: _door(size, False), 1.0),
    "door_glazed": Pattern(lambda size: _door(size, True), 1.0),
    "road": Pattern(_road, 1.0),
}
