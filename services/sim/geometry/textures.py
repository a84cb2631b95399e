"""Texture layers: what surfaces are made of, drawn by rule and seed, and the pictures that the catalogue brings.

A `TextureSet` maps names to layers of one texture array. `tile_m` says how many metres one repeat spans: mesh
coordinates `uv` are metres along the surface, divided by `tile_m` when a scene is uploaded; pictures have
`tile_m = 1`, so their uv is simply 0..1.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from services.sim.geometry.patterns import TILED
from services.sim.geometry.pictures import PICTURES

SIZE = 512
"""Pixels of a layer's side."""

Picture = NDArray[np.uint8]
Painter = Callable[[int], Picture]


class UnknownTexture(KeyError):
    """There is no layer of that name; the message lists those there are."""


@dataclass(frozen=True, eq=False)
class TextureSet:
    """images: (L, SIZE, SIZE, 3) uint8 sRGB, the top row first; tile_m: (L,) metres that one repeat spans."""

    names: tuple[str, ...]
    images: NDArray[np.uint8]
    tile_m: NDArray[np.float32]
    _index: Mapping[str, int] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_index", {name: i for i, name in enumerate(self.names)})

    def layer(self, name: str) -> int:
        """The layer's index. Raises UnknownTexture."""
        try:
            return self._index[name]
        except KeyError:
            raise UnknownTexture(f"there is no texture {name!r}; there are {', '.join(self.names)}") from None

    @cached_property
    def pane_layers(self) -> tuple[int, int]:
        """The first and the last of the layers that are window panes; they lie together."""
        panes = [i for i, name in enumerate(self.names) if name.startswith("pane_")]
        return panes[0], panes[-1]

    def with_pictures(self, pictures: Sequence[tuple[str, Picture]]) -> "TextureSet":
        """More layers, after those there are: (name, (H, W, 3) uint8 sRGB), spread over uv 0..1."""
        if not pictures:
            return self
        names = tuple(name for name, _ in pictures)
        twice = sorted((set(names) & set(self.names)) | {n for n in names if names.count(n) > 1})
        if twice:
            raise ValueError(f"texture names must be unique: {', '.join(twice)}")
        added = np.stack([cv2.resize(p, (SIZE, SIZE), interpolation=cv2.INTER_AREA) for _, p in pictures])
        return TextureSet(
            self.names + names,
            np.concatenate([self.images, added.astype(np.uint8)]),
            np.concatenate([self.tile_m, np.ones(len(names), np.float32)]),
        )

    def with_replaced(self, name: str, picture: Picture, tile_m: float) -> "TextureSet":
        """Another picture, (H, W, 3) uint8 sRGB, in place of that layer's. Raises UnknownTexture."""
        number = self.layer(name)
        images, tiles = self.images.copy(), self.tile_m.copy()
        images[number] = cv2.resize(picture, (SIZE, SIZE), interpolation=cv2.INTER_AREA)
        tiles[number] = tile_m
        return TextureSet(self.names, images, tiles)


@cache
def base_textures() -> TextureSet:
    """The layers every scene has; layer 0 is `plain` (white)."""
    patterns = {**TILED, **PICTURES}
    names = tuple(patterns)
    return TextureSet(
        names,
        np.stack([patterns[n].paint(SIZE) for n in names]),
        np.array([patterns[n].tile_m for n in names], np.float32),
    )
