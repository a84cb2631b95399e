"""A thing that is called red looks red: the named colour covers most of what the camera sees of it."""

import colorsys
from collections.abc import Iterator
from math import pi

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from contracts.geometry import Pose
from contracts.scene import Light
from contracts.sim import CatalogueEntry
from services.sim.catalogue import COLOURS, build, entries
from services.sim.catalogue.sheet import catalogue_textures
from services.sim.geometry.mesh import concatenate, rgb
from services.sim.geometry.scene_mesh import Chunk, Part, SceneMesh
from services.sim.geometry.textures import TextureSet
from services.sim.render.choice import choose_renderer
from services.sim.render.views import Renderer
from tests.cameras import square

CATEGORIES = tuple(dict.fromkeys(entry.category for entry in entries()))
SPACING_M = 2.2
SIZE_PX = 1000


@pytest.fixture(scope="module")
def renderer() -> Iterator[Renderer]:
    chosen = choose_renderer()
    yield chosen
    chosen.close()


@pytest.fixture(scope="module")
def textures() -> TextureSet:
    return catalogue_textures()


def shop_window(shown: list[tuple[CatalogueEntry, str]], columns: int, textures: TextureSet) -> SceneMesh:
    """Everything side by side in the plane x = 0, facing +x, rows of `columns`."""
    meshes = []
    for i, (entry, colour) in enumerate(shown):
        row, column = divmod(i, columns)
        mesh = build(entry.kind, colour, textures)
        low, high = mesh.bounds
        z = -row * SPACING_M - float(low[2] + high[2]) / 2
        meshes.append(mesh.transformed(move=(0, (column - (columns - 1) / 2) * SPACING_M, z)))
    first = np.cumsum([0] + [m.triangle_count for m in meshes])
    chunks = [
        Chunk(int(start), m.triangle_count, tuple(m.bounds[0].tolist()), tuple(m.bounds[1].tolist()))
        for start, m in zip(first, meshes, strict=False)
    ]
    return SceneMesh(
        mesh=concatenate(meshes),
        part_of=np.concatenate([np.full(m.vertex_count, i + 1, np.uint16) for i, m in enumerate(meshes)]),
        parts=tuple(Part(i + 1, "object", f"{e.kind} {c}") for i, (e, c) in enumerate(shown)),
        chunks=tuple(chunks),
        solids=(),
        textures=textures,
        light=Light(sun_azimuth=0.6, sun_elevation=0.7),
        focus=(0.0, 0.0, 0.0),
    )


def share_of(colour: str, pixels: NDArray[np.uint8]) -> float:
    """How many of the (N, 3) sRGB pixels one would call by that name, 0..1."""
    hue, saturation, top = cv2.cvtColor(pixels[None].astype(np.float32) / 255, cv2.COLOR_RGB2HSV)[0].T
    if colour == "white":
        return float(((saturation < 0.25) & (top > 0.5)).mean())
    if colour == "black":
        return float((top < 0.32).mean())
    wanted = colorsys.rgb_to_hsv(*(rgb(COLOURS[colour]) / 255).tolist())
    off = np.abs((hue / 360 - wanted[0] + 0.5) % 1 - 0.5)
    near = (off < 0.045) & (saturation > 0.5 * wanted[1])
    if colour in ("brown", "orange"):  # one hue: brown is dull and dark, orange stays vivid even in the shade
        near &= ((saturation < 0.74) & (top < 0.75)) == (colour == "brown")
    return float(near.mean())


@pytest.mark.parametrize("category", CATEGORIES)
def test_the_named_colour_dominates_every_object(category: str, renderer: Renderer, textures: TextureSet) -> None:
    shown = [(e, c) for e in entries() if e.category == category for c in e.colours]
    columns = 9
    rows = -(-len(shown) // columns)
    pose = Pose(x=11.0, y=0.0, z=-(rows - 1) / 2 * SPACING_M, yaw=pi)
    scene = renderer.upload(shop_window(shown, columns, textures))
    try:
        picture = renderer.render(scene, pose, [square(size=SIZE_PX)]).rgb[0]
        ids = renderer.render_ids(scene, pose, [square(size=SIZE_PX)])[0]
    finally:
        scene.release()
    weak = {}
    for i, (entry, colour) in enumerate(shown):
        pixels = picture[ids == i + 1]
        assert len(pixels) > 60, f"{colour} {entry.kind} is hardly visible"
        share = share_of(colour, pixels)
        if share < 0.5:
            weak[f"{colour} {entry.kind}"] = round(share, 2)
    assert weak == {}


def test_the_colours_are_far_apart() -> None:
    names = list(COLOURS)
    for i, a in enumerate(names):
        for b in names[i + 1 :]:
            assert np.abs(rgb(COLOURS[a]).astype(int) - rgb(COLOURS[b])).sum() > 90, (a, b)


@pytest.mark.parametrize("colour", COLOURS)
def test_a_colours_own_pixels_are_called_by_its_name_and_by_no_other(colour: str) -> None:
    pixel = rgb(COLOURS[colour])[None]
    assert [name for name in COLOURS if share_of(name, pixel) == 1.0] == [colour]
