"""The table of classes: what a builder says about itself, and how one is asked for by name.

An object's mount follows from its places. `stand` (sill, balcony, free): the origin is the middle of the underside.
`wall` (wall, pane): the middle of the back plane. `hang`: the top hook. +x is the front, +z is up, metres.
"""

from collections.abc import Callable
from functools import lru_cache
from typing import Literal, NamedTuple, get_args

from contracts.near import did_you_mean
from contracts.sim import CatalogueEntry
from services.sim.catalogue.palette import Paint
from services.sim.geometry.mesh import Mesh
from services.sim.geometry.scene_mesh import UnknownObject
from services.sim.geometry.textures import TextureSet

Category = Literal["tools", "containers", "household", "food", "furniture", "posters", "toys", "ornaments"]
Place = Literal["sill", "balcony", "wall", "pane", "hang", "free"]
Shape = Callable[[Paint], Mesh]

STANDING: tuple[Place, ...] = ("sill", "balcony", "free")
SMALL: tuple[Place, ...] = ("sill", "free")
BIG: tuple[Place, ...] = ("balcony", "free")
MOUNTED: tuple[Place, ...] = ("wall", "pane")
HANGING: tuple[Place, ...] = ("hang",)


class UnknownClass(UnknownObject):
    """The catalogue has no such class."""


class UnknownColour(UnknownObject):
    """The class does not come in that colour."""


class _Listed(NamedTuple):
    entry: CatalogueEntry
    shape: Shape


_table: dict[str, _Listed] = {}


def catalogued(
    category: Category,
    phrase: str,
    *synonyms: str,
    colours: tuple[str, ...],
    places: tuple[Place, ...],
    size_m: tuple[float, float, float],
) -> Callable[[Shape], Shape]:
    """Lists the decorated builder under its own name. `size_m` is its extent along x, y, z."""

    def enlist(shape: Shape) -> Shape:
        kind = shape.__name__
        if kind in _table:
            raise ValueError(f"class {kind} is listed twice")
        entry = CatalogueEntry(
            kind=kind,
            category=category,
            phrase=phrase,
            synonyms=synonyms,
            colours=colours,
            places=places,
            size_m=size_m,
        )
        _table[kind] = _Listed(entry, shape)
        return shape

    return enlist


def listed() -> tuple[CatalogueEntry, ...]:
    """Every class, by category in the paper's order."""
    order = get_args(Category)
    return tuple(sorted((item.entry for item in _table.values()), key=lambda entry: order.index(entry.category)))


def names_of(kind: str, colour: str) -> tuple[str, ...]:
    """All that people call a thing of that class and colour: with its colour first, then without."""
    item = _table.get(kind)
    names = (kind.replace("_", " "),) if item is None else (item.entry.phrase, *item.entry.synonyms)
    return (*(f"{colour} {name}" for name in names), *names)


@lru_cache(maxsize=256)
def build(kind: str, colour: str, textures: TextureSet) -> Mesh:
    """One object in metres, front +x, up +z; the module's text says where its origin lies.

    Raises UnknownClass or UnknownColour, which say what there is instead.
    """
    item = _table.get(kind)
    if item is None:
        raise UnknownClass(
            f"the catalogue has no class {kind!r}{did_you_mean(kind, _table)}; it has {', '.join(_table)}"
        )
    if colour not in item.entry.colours:
        raise UnknownColour(
            f"{kind} does not come in {colour!r}{did_you_mean(colour, item.entry.colours)}; "
            f"it comes in {', '.join(item.entry.colours)}"
        )
    return _seated(item.shape(Paint(colour, textures)), item.entry.places[0])


def _seated(mesh: Mesh, place: Place) -> Mesh:
    low, high = (corner.astype(float) for corner in mesh.bounds)
    x, y, z = (low + high) / 2
    if place in MOUNTED:
        x = low[0]
    else:
        z = high[2] if place in HANGING else low[2]
    return mesh.transformed(move=(-x, -y, -z))
