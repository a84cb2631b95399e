"""Facade families: walls, windows and roofs that belong together, each with a palette the seed draws from."""

from typing import Literal, NamedTuple

import numpy as np

from contracts.scene import BuildingKind, FacadeStyle, WindowGrid
from evaluation.scene_generator.scene_plan import Family

Roof = Literal["flat", "gable", "hip", "pagoda", "hall"]


class Dress(NamedTuple):
    """What a building wears."""

    style: FacadeStyle
    windows: WindowGrid
    floor_height_m: float
    roof: Roof


class _Range(NamedTuple):
    wall: Literal["plaster", "brick", "concrete", "panel", "stone", "wood", "lacquer"]
    walls: tuple[str, ...]
    trim: str
    frames: tuple[str, ...]
    accents: tuple[str, ...]
    roofs: tuple[Roof, ...]
    string_courses: bool = True


_PLAIN_FRAMES = ("#ecebe6", "#d9d6cf", "#5a5f63")
_RANGES: dict[Family, _Range] = {
    "pastel_plaster": _Range(
        "plaster",
        ("#e3cfa6", "#d9b8a4", "#c9d0bd", "#cdd3da"),
        "#f4f0e6",
        _PLAIN_FRAMES,
        ("#7a4a36", "#566573"),
        ("hip",),
    ),
    "red_brick": _Range(
        "brick", ("#a2604a", "#8d5243", "#b0755a"), "#e8e0d2", ("#efece4", "#3f4a46"), ("#4b4f52",), ("flat", "gable")
    ),
    "white_render": _Range(
        "plaster", ("#e9e6df", "#dddbd4"), "#fbfaf6", ("#4a5056", "#e6e4de"), ("#8a8d90",), ("flat",), False
    ),
    "grey_concrete": _Range(
        "concrete", ("#b3b1ac", "#a5a6a5", "#bdb7ab"), "#cfcdc8", ("#e2e2df", "#53585c"), ("#6c7a86",), ("flat",)
    ),
    "blue_panel": _Range(
        "panel", ("#aebbc6", "#c4c9c8", "#b9b3a5"), "#dfe3e5", ("#3c444b", "#e6e8e8"), ("#4d6478",), ("flat",)
    ),
    "sandstone": _Range(
        "stone", ("#cfbf9d", "#c4b59b"), "#e6dcc3", ("#e9e4d7", "#4b4238"), ("#6f5f49",), ("flat", "hip")
    ),
    "garden_plaster": _Range(
        "plaster",
        ("#ead9b4", "#e4e0d6", "#d8c4ae"),
        "#f7f3ea",
        ("#f2efe8", "#6a5440"),
        ("#8f4f38", "#5d6b54"),
        ("hip", "gable"),
    ),
    "painted_wood": _Range(
        "wood", ("#b7c2c4", "#c9bfa8", "#a98e72"), "#f4f1ea", ("#f4f1ea",), ("#5b6468",), ("gable",), False
    ),
    "cottage_brick": _Range(
        "brick", ("#b27a5f", "#9c6650"), "#efe8da", ("#f4f0e6",), ("#5c3d30",), ("gable", "hip"), False
    ),
    "red_lacquer": _Range(
        "lacquer", ("#a3483a", "#94453a"), "#d9c08a", ("#6d3a2c", "#7c5a34"), ("#3f6b58", "#4a5a6e"), ("pagoda", "hall")
    ),
    "temple_wood": _Range(
        "wood", ("#8a6548", "#9b7452"), "#e0d3b4", ("#5a4030",), ("#4f5f56", "#7a3b2e"), ("pagoda", "hall")
    ),
    "temple_stone": _Range(
        "stone", ("#c9bea6", "#d8d0bd"), "#efe7d3", ("#7a4a34", "#6b5138"), ("#8c3f31", "#44625a"), ("hall", "pagoda")
    ),
}

FAMILIES: dict[BuildingKind, tuple[Family, ...]] = {
    "low_rise": ("pastel_plaster", "red_brick", "white_render", "sandstone"),
    "high_rise": ("grey_concrete", "blue_panel", "white_render", "sandstone"),
    "villa": ("garden_plaster", "painted_wood", "cottage_brick", "white_render"),
    "cultural": ("red_lacquer", "temple_wood", "temple_stone"),
}


def dress(kind: BuildingKind, family: Family, pagoda: bool, rng: np.random.Generator) -> Dress:
    """One member of a family, drawn by `rng`; `pagoda` chooses between the two roofs of a cultural building."""
    choice = _RANGES[family]
    style = FacadeStyle(
        wall=choice.wall,
        wall_colour=str(rng.choice(choice.walls)),
        trim_colour=choice.trim,
        frame_colour=str(rng.choice(choice.frames)),
        accent_colour=str(rng.choice(choice.accents)),
        string_courses=choice.string_courses,
    )
    roof: Roof = str(rng.choice(choice.roofs))  # type: ignore[assignment]
    if kind == "cultural":
        roof = "pagoda" if pagoda else "hall"
    elif kind == "high_rise":
        roof = "flat"
    return Dress(style, _windows(kind, pagoda, rng), _floor_height_m(kind, pagoda), roof)


def _floor_height_m(kind: BuildingKind, pagoda: bool) -> float:
    if kind == "cultural":
        return 3.6 if pagoda else 4.0
    return {"low_rise": 3.1, "high_rise": 3.0, "villa": 3.0}[kind]


def _windows(kind: BuildingKind, pagoda: bool, rng: np.random.Generator) -> WindowGrid:
    curtains = round(float(rng.uniform(0.45, 0.8)), 2)
    if kind == "low_rise":
        shape: Literal["rectangle", "arched"] = "arched" if rng.random() < 0.15 else "rectangle"
        return WindowGrid(
            width_m=1.4, height_m=1.55, sill_m=0.9, pitch_m=3.1, margin_m=1.0, shape=shape, curtains=curtains
        )
    if kind == "high_rise":
        width_m = float(rng.choice((1.5, 1.8)))
        return WindowGrid(width_m=width_m, height_m=1.5, sill_m=0.85, pitch_m=3.2, margin_m=0.9, curtains=curtains)
    if kind == "villa":
        style: Literal["rectangle", "french"] = "french" if rng.random() < 0.3 else "rectangle"
        return WindowGrid(
            width_m=1.3, height_m=1.5, sill_m=0.85, pitch_m=3.0, margin_m=0.9, shape=style, curtains=curtains
        )
    if pagoda:
        return WindowGrid(
            width_m=1.3, height_m=1.5, sill_m=1.0, pitch_m=2.6, margin_m=0.7, shape="lattice", curtains=0.2
        )
    return WindowGrid(width_m=1.6, height_m=1.9, sill_m=0.9, pitch_m=3.2, margin_m=1.0, shape="lattice", curtains=0.2)
