"""Classes of other packages: modules that list their shapes with `@catalogued` when they are imported.

An entry point (group `logisticsvln.catalogue`) names such a module. Every class is built once in each of its colours
before the service takes it in, so that a scene never fails on one.
"""

from collections.abc import Callable

import numpy as np

from contracts.sim import Catalogue, CatalogueEntry
from service_kit.extensions import CATALOGUE, BadExtension, extensions, loaded
from services.sim.catalogue.registry import build, listed
from services.sim.geometry.textures import TextureSet

TOLERANCE_M = 0.05
"""How far the shape's extent may be off `size_m`, by which places are chosen."""


def catalogue_with_extensions(textures: Callable[[], TextureSet]) -> Catalogue:
    """All classes there are, ours and those of installed packages. Raises BadExtension, naming what is wrong."""
    for name, point in extensions(CATALOGUE).items():
        before = {entry.kind for entry in listed()}
        loaded(point)
        for entry in listed():
            if entry.kind not in before:
                _check(f"{point.value} ({name!r})", entry, textures())
    return Catalogue(entries=listed())


def _check(whose: str, entry: CatalogueEntry, textures: TextureSet) -> None:
    for colour in entry.colours:
        try:
            low, high = build(entry.kind, colour, textures).bounds
        except Exception as error:  # a stranger's code
            raise BadExtension(f"{whose}: {entry.kind} in {colour}: {type(error).__name__}: {error}") from error
        extent_m = np.asarray(high, np.float64) - np.asarray(low, np.float64)
        if not np.allclose(extent_m, entry.size_m, atol=TOLERANCE_M):
            measured = tuple(round(float(side), 2) for side in extent_m)
            raise BadExtension(f"{whose}: {entry.kind} is {measured} m large, not size_m={entry.size_m} as it says")
