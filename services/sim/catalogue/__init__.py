"""The object catalogue: what can stand, hang or stick at a window, and how each thing is built.

`CATALOGUE` says what there is (`extension` adds what other packages bring); `build(kind, colour, textures)` makes one
object in metres, front +x, up +z. Its origin follows from its places (see `registry`): the middle of the underside for
what stands, of the back plane for what sits on a wall or a pane, the top hook for what hangs. `poster_layers()` are the
pictures that the renderer's texture set needs.
"""

from contracts.sim import Catalogue, CatalogueEntry
from services.sim.catalogue import (  # noqa: F401 - a category's module lists its classes when it is imported
    containers,
    food,
    furniture,
    household,
    ornaments,
    posters,
    tools,
    toys,
    wall_ornaments,
)
from services.sim.catalogue.palette import COLOURS
from services.sim.catalogue.posters import poster_layers
from services.sim.catalogue.registry import UnknownClass, UnknownColour, build, listed

CATALOGUE = Catalogue(entries=listed())


def entries() -> tuple[CatalogueEntry, ...]:
    """Every class, by category."""
    return CATALOGUE.entries


__all__ = ["CATALOGUE", "COLOURS", "UnknownClass", "UnknownColour", "build", "entries", "poster_layers"]
