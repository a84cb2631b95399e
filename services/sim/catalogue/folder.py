"""Classes of objects and textures from a folder, without any code: `things.toml`, and the files that it names.

docs/scenes.md has the format. What is taken in stays for the process, as the classes of the project's own modules do.
"""

import tomllib
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import Field, ValidationError, model_validator

from contracts.base import Wire
from contracts.errors import first_problem
from service_kit.settings import BadSetting
from services.sim.catalogue.palette import COLOURS, Paint
from services.sim.catalogue.registry import MOUNTED, Category, Place, Shape, build, catalogued
from services.sim.geometry.mesh import Mesh, concatenate, make
from services.sim.geometry.solids import box, quad
from services.sim.geometry.textures import TextureSet

FILE = "things.toml"
MAX_FILE_BYTES, MAX_TRIANGLES, MAX_PICTURE_PX = 16 * 1024 * 1024, 20_000, 4096 * 4096
FLAT_M = 0.03
_KIND = r"^[a-z][a-z0-9_]{0,39}$"
Picture = NDArray[np.uint8]
Size = Annotated[float, Field(ge=0.02, le=3.0)]


class OwnObject(Wire):
    """A class: either a `mesh` (OBJ, GLB, PLY or STL), made `height_m` high, or a flat `picture` of `width_m` for a
    wall or a pane. A mesh takes the named colour, or its own ones (`keeps_colours`), or a `texture` by its uv. `up`:
    which of the mesh's axes points up; its front is +x, or +z where y points up."""

    category: Category
    phrase: str = Field(min_length=2, max_length=60)
    synonyms: tuple[str, ...] = Field(default=(), max_length=20)
    colours: tuple[str, ...] = Field(min_length=1, max_length=10)
    places: tuple[Place, ...] = Field(min_length=1, max_length=6)
    mesh: str | None = None
    picture: str | None = None
    texture: str | None = None
    up: Literal["y", "z"] = "z"
    height_m: Size | None = None
    width_m: Size = 0.9
    keeps_colours: bool = False

    @model_validator(mode="after")
    def _is_whole(self) -> Self:
        if (self.mesh is None) == (self.picture is None):
            raise ValueError("give either a mesh or a picture")
        if self.mesh is not None and self.height_m is None:
            raise ValueError("a mesh needs height_m, metres")
        if self.picture is not None and not set(self.places) <= set(MOUNTED):
            raise ValueError(f"a picture can be on {' or '.join(MOUNTED)} only")
        if unknown := [colour for colour in self.colours if colour not in COLOURS]:
            raise ValueError(f"there is no colour {unknown[0]!r}; there are {', '.join(COLOURS)}")
        return self


class OwnTexture(Wire):
    """A picture in place of one of the walls' and grounds' textures; one repeat spans `tile_m`."""

    picture: str
    tile_m: float = Field(default=1.0, ge=0.05, le=20.0)


class OwnThings(Wire):
    """A folder's `things.toml`."""

    objects: dict[Annotated[str, Field(pattern=_KIND)], OwnObject] = Field(default={}, max_length=100)
    textures: dict[str, OwnTexture] = Field(default={}, max_length=50)


def with_own_things(folder: Path, textures: TextureSet) -> TextureSet:
    """Lists the folder's classes, and gives the textures with the folder's. Every class is built once in each colour.
    Raises BadSetting, naming the file and what is wrong in it."""
    things = _read(folder)
    try:
        pictures = {kind: _picture(folder / name) for kind, one in things.objects.items() if (name := _shown(one))}
        textures = textures.with_pictures([(layer_of(kind), picture) for kind, picture in pictures.items()])
        for name, texture in things.textures.items():
            textures = textures.with_replaced(name, _picture(folder / texture.picture), texture.tile_m)
        for kind, one in things.objects.items():
            shape = _of_picture(kind, one, pictures[kind]) if one.picture is not None else _of_mesh(folder, kind, one)
            _enlist(kind, one, shape, textures)
            for colour in one.colours:
                build(kind, colour, textures)
    except (ValueError, KeyError, OSError) as error:
        said = error.args[0] if isinstance(error, KeyError) and error.args else error
        raise BadSetting(f"{folder / FILE}: {said}") from None
    return textures


def layer_of(kind: str) -> str:
    """The name of the texture layer that a class's picture lies in."""
    return f"own {kind}"


def _read(folder: Path) -> OwnThings:
    path = folder / FILE
    try:
        return OwnThings.model_validate(tomllib.loads(path.read_text(encoding="utf-8")))
    except OSError as error:
        raise BadSetting(f"{path}: {error.strerror}; SIM_THINGS names a folder with a {FILE}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise BadSetting(f"{path} is not TOML: {error}") from None
    except ValidationError as error:
        raise BadSetting(f"{path}: {first_problem(error)}") from None


def _shown(one: OwnObject) -> str | None:
    return one.picture or one.texture


def _enlist(kind: str, one: OwnObject, shape: Shape, textures: TextureSet) -> None:
    """Lists the class under its name. Raises ValueError for one that is there."""
    low, high = shape(Paint(one.colours[0], textures)).bounds
    x, y, z = (round(float(side), 3) for side in high - low)
    shape.__name__ = kind
    catalogued(one.category, one.phrase, *one.synonyms, colours=one.colours, places=one.places, size_m=(x, y, z))(shape)


def _of_picture(kind: str, one: OwnObject, picture: Picture) -> Shape:
    height, width = picture.shape[:2]
    wide, high = one.width_m, one.width_m * height / width

    def shape(paint: Paint) -> Mesh:
        board = box((FLAT_M, wide, high), colour=paint.main, without=("+x",))
        x, y, z = FLAT_M / 2, wide / 2, high / 2
        corners = [(x, -y, -z), (x, y, -z), (x, y, z), (x, -y, z)]
        uv = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
        return concatenate([board, quad(corners, "#ffffff", paint.textures.layer(layer_of(kind)), uv)])

    return shape


def _of_mesh(folder: Path, kind: str, one: OwnObject) -> Shape:
    import trimesh  # heavy, and only needed where a folder has meshes

    path = folder / str(one.mesh)
    if path.stat().st_size > MAX_FILE_BYTES:
        raise ValueError(f"{one.mesh} is larger than {MAX_FILE_BYTES // 2**20} MiB")
    try:
        loaded: Any = trimesh.load(path, force="mesh", process=False, skip_materials=one.texture is None)
    except Exception as error:  # a file of anybody's, read by somebody else's code
        raise ValueError(f"{one.mesh} is no mesh that can be read: {type(error).__name__}: {error}") from None
    if not 0 < len(loaded.faces) <= MAX_TRIANGLES:
        raise ValueError(f"{one.mesh} has {len(loaded.faces)} triangles; from 1 to {MAX_TRIANGLES} are drawn")
    turn = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]) if one.up == "y" else np.eye(3)
    points = np.asarray(loaded.vertices, np.float64) @ turn.T
    normals = np.asarray(loaded.vertex_normals, np.float64) @ turn.T
    tall = float(np.ptp(points[:, 2]))
    if not np.isfinite(points).all() or tall <= 0.0:
        raise ValueError(f"{one.mesh} has no height along its {one.up} axis")
    points *= float(one.height_m or 0.0) / tall
    uv = getattr(loaded.visual, "uv", None)
    if one.texture is not None and uv is None:
        raise ValueError(f"{one.mesh} has no texture coordinates for {one.texture}")
    flat_uv = np.zeros((len(points), 2)) if uv is None else np.asarray(uv, np.float64)
    kept = np.asarray(loaded.visual.to_color().vertex_colors[:, :3], np.uint8) if one.keeps_colours else None

    def shape(paint: Paint) -> Mesh:
        layer = paint.textures.layer(layer_of(kind)) if one.texture is not None else 0
        colour = "#ffffff" if one.texture is not None else paint.main
        mesh = make(points, loaded.faces, normals, flat_uv, colour, layer)
        return mesh if kept is None else Mesh(mesh.positions, mesh.normals, mesh.uv, kept, mesh.layer, mesh.faces)

    return shape


def _picture(path: Path) -> Picture:
    """(H, W, 3) uint8 sRGB. Raises ValueError, OSError."""
    if path.stat().st_size > MAX_FILE_BYTES:
        raise ValueError(f"{path.name} is larger than {MAX_FILE_BYTES // 2**20} MiB")
    bgr = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if bgr is None or bgr.shape[0] * bgr.shape[1] > MAX_PICTURE_PX:
        raise ValueError(f"{path.name} is no picture that can be read, or has more than {MAX_PICTURE_PX} pixels")
    return np.asarray(cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB), np.uint8)
