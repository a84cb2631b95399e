"""The contact sheet: every class of the catalogue as the renderer shows it, with its name and its colours."""

from functools import cache
from math import cos, pi, radians, sin
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from contracts.cameras import pinhole_camera
from contracts.geometry import Pose
from contracts.scene import Light
from contracts.sim import CatalogueEntry
from service_kit.lettering import draw_text, text_width
from services.sim.catalogue import COLOURS, build, entries, poster_layers
from services.sim.geometry.mesh import Mesh, rgb
from services.sim.geometry.scene_mesh import Chunk, Part, SceneMesh
from services.sim.geometry.textures import TextureSet, base_textures
from services.sim.render.views import Renderer

COLUMNS = 9
TILE_W, PICTURE_H, TEXT_H = 216, 200, 50
HEAD_H = 40
PAPER = (233, 231, 226)
_TEXT = (40, 40, 44)


class Portrait(NamedTuple):
    """rgb (H, W, 3) uint8 sRGB; seen (H, W) bool: where the object is."""

    rgb: NDArray[np.uint8]
    seen: NDArray[np.bool_]


@cache
def catalogue_textures() -> TextureSet:
    """The layers of every scene, with the posters' pictures."""
    return base_textures().with_pictures(poster_layers())


def alone(mesh: Mesh, textures: TextureSet) -> SceneMesh:
    """A scene of one object and nothing else."""
    low, high = (tuple(float(v) for v in corner) for corner in mesh.bounds)
    return SceneMesh(
        mesh=mesh,
        part_of=np.ones(mesh.vertex_count, np.uint16),
        parts=(Part(1, "object", "object"),),
        chunks=(Chunk(0, mesh.triangle_count, low, high),),  # type: ignore[arg-type]
        solids=(),
        textures=textures,
        light=Light(sun_azimuth=0.7, sun_elevation=0.7),
        focus=(0.0, 0.0, 0.0),
    )


def portrait(
    renderer: Renderer,
    mesh: Mesh,
    textures: TextureSet,
    size: int,
    distance_m: float | None = None,
    azimuth_deg: float = 20.0,
    elevation_deg: float = 12.0,
) -> Portrait:
    """One object seen from its front, `azimuth_deg` to its left; without a distance, from three times its reach."""
    low, high = (corner.astype(float) for corner in mesh.bounds)
    middle = (low + high) / 2
    away = distance_m or 3.0 * float(np.linalg.norm(high - low)) / 2
    a, e = radians(azimuth_deg), radians(elevation_deg)
    eye = middle + away * np.array([cos(a) * cos(e), sin(a) * cos(e), sin(e)])
    camera = pinhole_camera("portrait", size, size, horizontal_fov_deg=90.0)
    scene = renderer.upload(alone(mesh, textures))
    try:
        pose = Pose(x=eye[0], y=eye[1], z=eye[2], yaw=a + pi)
        picture = renderer.render(scene, pose, [camera]).rgb[0]
        seen = renderer.render_ids(scene, pose, [camera])[0] == 1
    finally:
        scene.release()
    return Portrait(picture, seen)


def contact_sheet(renderer: Renderer) -> NDArray[np.uint8]:
    """(H, W, 3) sRGB: a grid by category."""
    textures = catalogue_textures()
    rows: list[NDArray[np.uint8]] = []
    for category in dict.fromkeys(entry.category for entry in entries()):
        members = [entry for entry in entries() if entry.category == category]
        rows.append(_heading(f"{category} ({len(members)})"))
        tiles = [_tile(renderer, textures, entry, i) for i, entry in enumerate(members)]
        tiles += [_blank(PICTURE_H + TEXT_H, TILE_W)] * (-len(tiles) % COLUMNS)
        rows += [np.hstack(tiles[i : i + COLUMNS]) for i in range(0, len(tiles), COLUMNS)]
    return np.vstack(rows)


def _tile(renderer: Renderer, textures: TextureSet, entry: CatalogueEntry, number: int) -> NDArray[np.uint8]:
    # a class that comes in anything is shown in the next colour, one that has a colour of its own in that one
    colour = entry.colours[number % len(entry.colours) if entry.colours[0] == "red" else 0]
    shot = portrait(renderer, build(entry.kind, colour, textures), textures, 1024)
    rows, columns = np.nonzero(shot.seen)
    top, bottom, left, right = rows.min(), rows.max() + 1, columns.min(), columns.max() + 1
    cut = np.where(shot.seen[..., None], shot.rgb, np.array(PAPER, np.uint8))[top:bottom, left:right]
    scale = min((TILE_W - 24) / cut.shape[1], (PICTURE_H - 20) / cut.shape[0])
    small = cv2.resize(cut, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    tile = _blank(PICTURE_H + TEXT_H, TILE_W)
    y, x = PICTURE_H - 6 - small.shape[0], (TILE_W - small.shape[1]) // 2
    tile[y : y + small.shape[0], x : x + small.shape[1]] = small
    _centred(tile, entry.phrase, PICTURE_H + 16, 16)
    first = (TILE_W - 18 * len(entry.colours)) // 2
    for i, colour in enumerate(entry.colours):
        corner = (first + 18 * i + 1, PICTURE_H + 25)
        cv2.rectangle(tile, corner, (corner[0] + 15, corner[1] + 15), rgb(COLOURS[colour]).tolist(), cv2.FILLED)
        cv2.rectangle(tile, corner, (corner[0] + 15, corner[1] + 15), (150, 150, 150), 1)
    return tile


def _heading(text: str) -> NDArray[np.uint8]:
    band = np.full((HEAD_H, TILE_W * COLUMNS, 3), (74, 82, 96), np.uint8)
    draw_text(band, text, (14, 27), 21, (250, 250, 250))
    return band


def _blank(height: int, width: int) -> NDArray[np.uint8]:
    return np.full((height, width, 3), PAPER, np.uint8)


def _centred(picture: NDArray[np.uint8], text: str, baseline: int, size_px: int) -> None:
    left = (picture.shape[1] - text_width(text, size_px)) // 2
    draw_text(picture, text, (left, baseline), size_px, _TEXT)
