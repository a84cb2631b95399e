"""What makes a street of a scene rich: hedges, fences, poles and the wires between them; signs and awnings at houses.

Part of the scene document (`contracts.scene`): metres, ENU. All of it is solid.
"""

import math
from collections.abc import Iterable
from typing import Annotated, Literal, Self

from pydantic import Field, StringConstraints, model_validator

from contracts.base import Rgb, Wire
from contracts.geometry import Point2, Point3

LONGEST_M = 60.0
"""Of one hedge or fence; a longer one is several."""
LONGEST_SPAN_M = 150.0
LOWEST_WIRE_M = 0.5
LOWEST_AWNING_M = 1.8
VALANCE_M = 0.18
"""How far the cloth hangs down at an awning's front edge."""
_ROUNDED_M = 1e-6
HIGHEST_WIRE_M = 60.0
SignText = Annotated[str, StringConstraints(strip_whitespace=True, min_length=1, max_length=24)]


class _Along(Wire):
    start: Point2
    end: Point2

    @model_validator(mode="after")
    def _long_enough(self) -> Self:
        length_m = ((self.end.x - self.start.x) ** 2 + (self.end.y - self.start.y) ** 2) ** 0.5
        if not 0.3 <= length_m <= LONGEST_M:
            raise ValueError(f"from start to end must be 0.3 to {LONGEST_M:g} m, not {length_m:.2f} m")
        return self


class Hedge(_Along):
    """A clipped hedge between two points."""

    height_m: float = Field(default=1.2, ge=0.3, le=4.0)
    width_m: float = Field(default=0.7, ge=0.3, le=2.0)


class Fence(_Along):
    """A garden wall, a fence of wooden pickets or of metal bars between two points."""

    kind: Literal["wall", "pickets", "bars"] = "pickets"
    height_m: float = Field(default=1.0, ge=0.3, le=3.0)
    colour: Rgb = "#d9d4c8"


class Pole(Wire):
    """A pole that carries wires, and for itself a bare one."""

    position: Point2
    height_m: float = Field(default=7.0, ge=2.0, le=20.0)
    kind: Literal["wood", "steel"] = "wood"


class OverheadWire(Wire):
    """A wire between two places, at poles, walls or wherever; in its middle it hangs `sag_m` below the straight line.

    Depth of real profiles loses most of it (docs/sim-to-real.md).
    """

    start: Point3
    end: Point3
    sag_m: float = Field(default=0.4, ge=0.0, le=5.0)
    diameter_m: float = Field(default=0.02, ge=0.004, le=0.1)

    @model_validator(mode="after")
    def _hangs(self) -> Self:
        span_m = ((self.end.x - self.start.x) ** 2 + (self.end.y - self.start.y) ** 2) ** 0.5
        if not 0.5 <= span_m <= LONGEST_SPAN_M:
            raise ValueError(f"a wire spans 0.5 to {LONGEST_SPAN_M:g} m of the plan, not {span_m:.2f} m")
        if max(self.start.z, self.end.z) > HIGHEST_WIRE_M:
            raise ValueError(
                f"a wire hangs no higher than {HIGHEST_WIRE_M:g} m, not {max(self.start.z, self.end.z):g} m"
            )
        low_m = min(self.height_m(k / 20) for k in range(21))
        if low_m < LOWEST_WIRE_M:
            raise ValueError(
                f"the wire hangs down to {low_m:.2f} m; at least {LOWEST_WIRE_M:g} m above the ground: less sag_m, or "
                "higher ends"
            )
        return self

    def height_m(self, share: float) -> float:
        """Above ground, so far along (0..1): a parabola."""
        return self.start.z + (self.end.z - self.start.z) * share - 4.0 * self.sag_m * share * (1.0 - share)


class AtWindows(Wire):
    """Over windows that lie side by side on one floor of a facade: `columns` of them from `column` on."""

    facade: int = Field(ge=0, le=31)
    floor: int = Field(default=1, ge=1, le=60)
    column: int = Field(ge=0, le=99)
    columns: int = Field(default=1, ge=1, le=20)


class Awning(AtWindows):
    """Cloth on arms over those windows, `depth_m` out of the wall; its front edge is `drop_m` lower than its back: 0 is
    a flat canopy. `stripes`: every second strip's colour; null: plain."""

    depth_m: float = Field(default=1.2, ge=0.4, le=3.0)
    drop_m: float = Field(default=0.35, ge=0.0, le=1.5)
    colour: Rgb = "#9c2f2b"
    stripes: Rgb | None = None


class Sign(AtWindows):
    """A shop's sign: a `board` along the wall over those windows, or one that stands out from the wall (`projecting`)
    after the last of them."""

    text: SignText
    kind: Literal["board", "projecting"] = "board"
    colour: Rgb = "#24303c"
    letters: Rgb = "#f4efe2"


def awning_top_m(floor: int, window_top_m: float, floor_height_m: float) -> float:
    """Where an awning over a window of that floor meets the wall, above ground; `window_top_m` above the floor."""
    return (floor - 1) * floor_height_m + min(window_top_m + 0.3, floor_height_m - 0.04)


def low_awning(awnings: Iterable[Awning], window_top_m: float, floor_height_m: float) -> str | None:
    """What is wrong with the first awning that one would walk into."""
    for awning in awnings:
        edge_m = awning_top_m(awning.floor, window_top_m, floor_height_m) - awning.drop_m - VALANCE_M
        if edge_m < LOWEST_AWNING_M - _ROUNDED_M:
            most_m = math.floor(100.0 * (awning.drop_m - (LOWEST_AWNING_M - edge_m) + _ROUNDED_M)) / 100.0
            advice = f"drop_m of at most {most_m:.2f}" if most_m >= 0.0 else "taller windows"
            return f"an awning would hang down to {edge_m:.2f} m; at least {LOWEST_AWNING_M:g} m is needed: {advice}"
    return None


def _none(found: tuple[Wire, ...]) -> bool:
    return not found


Hedges = Annotated[tuple[Hedge, ...], Field(max_length=100, exclude_if=_none)]
Fences = Annotated[tuple[Fence, ...], Field(max_length=60, exclude_if=_none)]
Poles = Annotated[tuple[Pole, ...], Field(max_length=60, exclude_if=_none)]
Wires = Annotated[tuple[OverheadWire, ...], Field(max_length=60, exclude_if=_none)]
Awnings = Annotated[tuple[Awning, ...], Field(max_length=40, exclude_if=_none)]
Signs = Annotated[tuple[Sign, ...], Field(max_length=40, exclude_if=_none)]
