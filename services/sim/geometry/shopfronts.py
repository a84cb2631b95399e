"""Awnings and shop signs on a building's facades, in the wall's axes: x out of it, y along it, z above ground."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from contracts.scene import Building
from contracts.scene_layout import window_slot
from contracts.scene_street import VALANCE_M, AtWindows, Awning, Sign, awning_top_m
from services.sim.geometry.letters import letters
from services.sim.geometry.mesh import Colour, Mesh, concatenate, mixed
from services.sim.geometry.parts import Assembly, stamped, wall_frame
from services.sim.geometry.solids import box, quad
from services.sim.geometry.tubes import rod
from services.sim.geometry.windows import SLAB_M

_BESIDE_M = 0.2
_STRIP_M = 0.28
_CLOTH_M = 0.03
_BOARD_M = (0.30, 0.60)
_BOARD_OFF_M, _BOARD_THICK_M = 0.13, 0.06
_BLADE_M = (0.72, 0.56, 0.07)
_BLADE_OFF_M = 0.22
_METAL = "#3a3d40"


class _Span(NamedTuple):
    """`frame` (4, 4): the wall's axes at the foot of the wall, in the middle of the windows."""

    frame: NDArray[np.float64]
    width_m: float


def build_shopfronts(assembly: Assembly, part: int, building: Building) -> None:
    """Draws what the building has of them, as solid as drawn. Raises ValueError for windows that are not there."""
    for number, awning in enumerate(building.awnings):
        span = _span(building, awning, f"awning {number}")
        _put(assembly, part, _awning(building, awning, span.width_m), span)
    for number, sign in enumerate(building.signs):
        span = _span(building, sign, f"sign {number}")
        drawn, solid = _board(building, sign, span.width_m) if sign.kind == "board" else _blade(building, sign, span)
        assembly.draw(part, stamped(drawn, [span.frame]))
        assembly.block(part, stamped(solid, [span.frame]))


def _put(assembly: Assembly, part: int, mesh: Mesh, span: _Span) -> None:
    placed = stamped(mesh, [span.frame])
    assembly.draw(part, placed)
    assembly.block(part, placed)


def _span(building: Building, place: AtWindows, what: str) -> _Span:
    try:
        first = window_slot(building, place.facade, place.floor, place.column)
        last = window_slot(building, place.facade, place.floor, place.column + place.columns - 1)
    except ValueError as error:
        raise ValueError(f"{what} of building {building.id}: {error}") from None
    x, y = ((a + b) / 2 for a, b in zip(first.centre[:2], last.centre[:2], strict=True))
    width_m = first.width_m + (place.columns - 1) * building.windows.pitch_m
    return _Span(wall_frame(first.normal, first.along, (x, y, 0.0)), width_m)


def _awning(building: Building, awning: Awning, width_m: float) -> Mesh:
    """Cloth in strips, two cheeks, a valance and the arms that hold it."""
    back = _above_windows_m(building, awning)
    half, deep, front = width_m / 2 + _BESIDE_M, awning.depth_m, back - awning.drop_m
    strips = max(2, round(2 * half / _STRIP_M))
    edges = np.linspace(-half, half, strips + 1)
    parts: list[Mesh] = []
    for k in range(strips):
        colour: Colour = awning.stripes if awning.stripes is not None and k % 2 else awning.colour
        parts += _strip(float(edges[k]), float(edges[k + 1]), deep, back, front, colour)
    for y in (-half, half):
        cheek = [(0.0, y, back - VALANCE_M), (deep, y, front - VALANCE_M), (deep, y, front), (0.0, y, back)]
        parts.append(quad(cheek, mixed(awning.colour, "#000000", 0.12)).two_sided())
    for y in (-half + 0.06, half - 0.06):
        parts.append(rod((0.0, y, back - VALANCE_M - 0.25), (deep - 0.03, y, front - 0.06), 0.018, 6, _METAL))
    return concatenate(parts)


def _strip(y0: float, y1: float, deep: float, back: float, front: float, colour: Colour) -> list[Mesh]:
    """One strip of the cloth, its underside and its end that hangs down."""
    low = mixed(colour, "#000000", 0.25)
    hem = front - VALANCE_M
    t = _CLOTH_M
    return [
        quad([(deep, y0, front), (deep, y1, front), (0.0, y1, back), (0.0, y0, back)], colour),
        quad([(0.0, y0, back - t), (0.0, y1, back - t), (deep, y1, front - t), (deep, y0, front - t)], low),
        quad([(deep, y0, hem), (deep, y1, hem), (deep, y1, front), (deep, y0, front)], colour),
        quad([(deep - t, y1, hem), (deep - t, y0, hem), (deep - t, y0, front), (deep - t, y1, front)], low),
        quad([(deep - t, y0, hem), (deep - t, y1, hem), (deep, y1, hem), (deep, y0, hem)], low),
    ]


def _board(building: Building, sign: Sign, width_m: float) -> tuple[Mesh, Mesh]:
    """Above the windows and their awning, below the next floor's windows or balconies."""
    floor_top = sign.floor * building.floor_height_m
    balconied = any(
        window_slot(building, sign.facade, sign.floor + 1, sign.column + k).balcony
        for k in range(sign.columns if sign.floor < building.floors else 0)
    )
    high = floor_top - SLAB_M if balconied else floor_top + building.windows.sill_m - 0.12
    low = (
        _above_windows_m(building, sign) + 0.06 if _has_awning(building, sign) else _window_top_m(building, sign) + 0.06
    )
    height = min(max(high - low, _BOARD_M[0]), _BOARD_M[1])
    size = (_BOARD_THICK_M, width_m + 2 * _BESIDE_M - 0.1, height)
    board = box(size, (_BOARD_OFF_M, 0.0, low + height / 2), sign.colour)
    rim = mixed(sign.colour, sign.letters, 0.35)
    face = _BOARD_OFF_M + _BOARD_THICK_M / 2
    edges = [box((0.02, size[1], 0.03), (face, 0.0, low + z), rim) for z in (0.015, height - 0.015)]
    text = letters(sign.text, size[1] - 0.3, height * 0.58, sign.letters).transformed(
        move=(face + 0.012, 0.0, low + height / 2)
    )
    return concatenate([board, *edges, text]), board


def _blade(building: Building, sign: Sign, span: _Span) -> tuple[Mesh, Mesh]:
    """Out of the wall between two windows, with its text on both sides."""
    (deep, high, thick), top = _BLADE_M, _above_windows_m(building, sign) + 0.3
    beside = min((building.windows.pitch_m - building.windows.width_m) / 2, 0.6)
    y, x = span.width_m / 2 + beside, _BLADE_OFF_M + deep / 2
    plate = box((deep, thick, high), (x, y, top - high / 2), sign.colour)
    arm = rod((0.0, y, top + 0.06), (_BLADE_OFF_M + deep, y, top + 0.06), 0.02, 6, _METAL)
    hooks = [rod((at, y, top + 0.06), (at, y, top - 0.01), 0.012, 4, _METAL) for at in (x - 0.25, x + 0.25)]
    text = letters(sign.text, deep - 0.1, high * 0.5, sign.letters)
    faces = [
        text.transformed(yaw=turn, move=(x, y + side * (thick / 2 + 0.01), top - high / 2))
        for turn, side in ((np.pi / 2, 1.0), (-np.pi / 2, -1.0))
    ]
    held = concatenate([plate, arm, *hooks])
    return concatenate([held, *faces]), held


def _has_awning(building: Building, sign: Sign) -> bool:
    return any(
        (awning.facade, awning.floor) == (sign.facade, sign.floor)
        and awning.column < sign.column + sign.columns
        and sign.column < awning.column + awning.columns
        for awning in building.awnings
    )


def _window_top_m(building: Building, place: AtWindows) -> float:
    """Above ground."""
    windows = building.windows
    return (place.floor - 1) * building.floor_height_m + windows.sill_m + windows.height_m


def _above_windows_m(building: Building, place: AtWindows) -> float:
    """Where an awning meets the wall there, above ground."""
    return awning_top_m(place.floor, building.windows.sill_m + building.windows.height_m, building.floor_height_m)
