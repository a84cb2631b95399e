"""The colours of the catalogue by name, and the accents that set them off.

A named colour covers most of what one sees of an object; accents are there to say what the object is.
"""

from dataclasses import dataclass

from services.sim.geometry.mesh import Colour, mixed
from services.sim.geometry.textures import TextureSet

COLOURS: dict[str, str] = {
    "red": "#c81a1e",
    "orange": "#f27a0c",
    "yellow": "#f8d21c",
    "green": "#23923a",
    "blue": "#1d5fd0",
    "purple": "#7a2fae",
    "pink": "#f47fb6",
    "white": "#f6f6f2",
    "black": "#1c1c20",
    "brown": "#684028",
}

BRIGHT = ("red", "orange", "yellow", "green", "blue", "purple", "pink", "white")
"""The colours that plastic, paint and cloth come in."""

CREAM = "#fbf6e6"
INK = "#25262c"
STEEL = "#b4bac2"
WOOD = "#b98a52"
TAN = "#d9a55c"
LEAF = "#2f7d32"
GOLD = "#e3b02c"
SKIN = "#f1bd92"
GLASS = "#a9d3ea"

_PALE = ("white", "yellow", "pink")


@dataclass(frozen=True)
class Paint:
    """What a shape is painted with: the named colour, and the scene's texture layers (for posters)."""

    colour: str
    textures: TextureSet

    @property
    def main(self) -> Colour:
        return COLOURS[self.colour]

    @property
    def dark(self) -> Colour:
        """The named colour in shadow: still that colour, for gaps, folds and undersides."""
        return mixed(self.main, "#7c828c", 0.35) if self.colour == "white" else mixed(self.main, "#000000", 0.3)

    @property
    def light(self) -> Colour:
        return mixed(self.main, "#ffffff", 0.14)

    @property
    def accent(self) -> Colour:
        """What stands out from the named colour: cream on dark colours, ink on pale ones."""
        return INK if self.colour in _PALE else CREAM

    @property
    def metal(self) -> Colour:
        return "#6d747d" if self.colour in ("white", "black") else STEEL

    @property
    def ink(self) -> Colour:
        """Dark details; pale on black."""
        return STEEL if self.colour == "black" else INK

    @property
    def foliage(self) -> Colour:
        return "#145a26" if self.colour in ("green",) else LEAF

    def other(self, first: Colour, second: Colour, *avoid: str) -> Colour:
        """`first`, or `second` where the named colour is one of `avoid`."""
        return second if self.colour in avoid else first
