"""The fallback without OpenGL: PyBullet's TinyRenderer draws the same triangles, plainer and about ten times slower.

Tiled textures are replaced by their mean colour; pictures (window panes, posters) stay. All of them live in one
atlas, because a body has one texture.
"""

import tempfile
from collections.abc import Sequence
from dataclasses import replace
from math import ceil, cos, sin, sqrt
from pathlib import Path
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from contracts.cameras import Camera
from contracts.geometry import Pose
from contracts.images import DEPTH_METRES_PER_UNIT, NO_RETURN
from services.sim.bullet import pybullet
from services.sim.geometry.mesh import Mesh, concatenate
from services.sim.geometry.scene_mesh import SceneMesh
from services.sim.physics_meshes import visual_mesh
from services.sim.render.light import WEATHER, airlight, extinction_per_m, sun_direction
from services.sim.render.views import RenderedViews, check_cameras, eye_of, view_axes

NEAR_M, FAR_M = 0.1, 400.0
_CELL = 64
_ATLAS = 2048
_MAX_FACES = 20_000


class TinyScene:
    """One scene in a PyBullet client of its own."""

    def __init__(self, scene: SceneMesh) -> None:
        scene = _one_colour_per_face(_with_movers(scene))
        self.scene = scene
        self.client = pybullet.connect(pybullet.DIRECT)
        self.part_of_body = np.zeros(1, np.uint16)
        bodies: dict[int, int] = {}
        atlas, uv = _atlas(scene)
        with tempfile.TemporaryDirectory() as folder:
            path = str(Path(folder) / "atlas.png")
            cv2.imwrite(path, cv2.cvtColor(atlas, cv2.COLOR_RGB2BGR))
            texture = pybullet.loadTexture(path, physicsClientId=self.client)
        part_of_face = scene.part_of[scene.mesh.faces[:, 0]]
        for part in np.unique(part_of_face):
            faces = np.nonzero(part_of_face == part)[0]
            for at in range(0, len(faces), _MAX_FACES):
                bodies[self._body(scene.mesh.faces[faces[at : at + _MAX_FACES]], uv, texture)] = int(part)
        self.part_of_body = np.zeros(max(bodies, default=0) + 2, np.uint16)
        for body, part in bodies.items():
            self.part_of_body[body] = part
        moving = {part.part: part for part in scene.moving}
        self._moving = [(body, moving[part]) for body, part in bodies.items() if part in moving]

    def _body(self, faces: NDArray[np.uint32], uv: NDArray[np.float32], texture: int) -> int:
        used, indices = np.unique(faces, return_inverse=True)
        mesh = self.scene.mesh
        shape = visual_mesh(mesh.positions[used], mesh.normals[used], uv[used], indices, self.client)
        body = int(pybullet.createMultiBody(0, -1, shape, physicsClientId=self.client))
        pybullet.changeVisualShape(body, -1, textureUniqueId=texture, physicsClientId=self.client)
        return body

    def place(self, time_s: float, pose: Pose) -> None:
        """Puts what moves where it is at that time; it has one shape alone, so that nobody's legs swing."""
        drone = np.array((pose.x, pose.y, pose.z))
        for body, part in self._moving:
            x, y, z, yaw = part.place(time_s, drone)
            turned = (0.0, 0.0, sin(yaw / 2.0), cos(yaw / 2.0))
            pybullet.resetBasePositionAndOrientation(body, (x, y, z), turned, physicsClientId=self.client)

    def release(self) -> None:
        pybullet.disconnect(self.client)


class TinyRenderer:
    """Same views as the OpenGL renderer's, without shadows, clouds and tiled textures."""

    name: Literal["moderngl", "tiny"] = "tiny"

    def __init__(self, reason: str = "asked for") -> None:
        self.detail = f"tiny (PyBullet TinyRenderer): {reason}"

    def upload(self, scene: SceneMesh) -> TinyScene:
        return TinyScene(scene)

    def render(
        self,
        uploaded: TinyScene,
        pose: Pose,
        cameras: Sequence[Camera],
        time_s: float = 0.0,
        *,
        labelled: bool = False,
        panes: bool = False,
    ) -> RenderedViews:
        """Picture and depth of each camera, ids where asked for; panes are not told. Raises ValueError beyond the
        limits."""
        check_cameras(cameras)
        uploaded.place(time_s, pose)
        rgb, depth, ids = [], [], []
        for camera in cameras:
            colour, buffer, bodies = _picture(uploaded, pose, camera)
            hit = buffer < 1.0
            metres = FAR_M * NEAR_M / (FAR_M - (FAR_M - NEAR_M) * buffer)
            units = np.clip(np.rint(metres / DEPTH_METRES_PER_UNIT), 1, NO_RETURN)
            depth.append(np.where(hit, units, NO_RETURN).astype(np.uint16))
            picture = np.where(hit[..., None], colour, _sky(uploaded.scene, camera)).astype(np.uint8)
            rgb.append(_through_air(uploaded.scene, picture, np.where(hit, metres, FAR_M)))
            ids.append(uploaded.part_of_body[bodies])
        return RenderedViews(tuple(rgb), tuple(depth), tuple(ids) if labelled else None)

    def render_ids(
        self, uploaded: TinyScene, pose: Pose, cameras: Sequence[Camera], time_s: float = 0.0
    ) -> tuple[NDArray[np.uint16], ...]:
        """(H, W) ids of parts of each camera. Raises ValueError beyond the limits."""
        check_cameras(cameras)
        uploaded.place(time_s, pose)
        return tuple(uploaded.part_of_body[_picture(uploaded, pose, camera)[2]] for camera in cameras)

    def close(self) -> None:
        """Nothing is held beyond the scenes, which release themselves."""


def _picture(
    uploaded: TinyScene, pose: Pose, camera: Camera
) -> tuple[NDArray[np.uint8], NDArray[np.float64], NDArray[np.int64]]:
    """Colours (H, W, 3), depth buffer (H, W) 0..1 and bodies (H, W), -1 for none."""
    eye = eye_of(pose, camera)
    _, up, forward = view_axes(pose, camera)
    light = uploaded.scene.light
    weather = WEATHER[light.sky]
    width, height = camera.width, camera.height
    view = pybullet.computeViewMatrix(eye.tolist(), (eye + forward).tolist(), up.tolist())
    lens = list(
        pybullet.computeProjectionMatrix(
            -camera.cx_px / camera.fx_px * NEAR_M,
            (width - camera.cx_px) / camera.fx_px * NEAR_M,
            -(height - camera.cy_px) / camera.fy_px * NEAR_M,
            camera.cy_px / camera.fy_px * NEAR_M,
            NEAR_M,
            FAR_M,
        )
    )
    # TinyRenderer samples a pixel at its lower left corner: move the picture half a pixel, so that centres are hit
    lens[8], lens[9] = lens[8] + 1 / width, lens[9] + 1 / height
    _, _, rgba, depth, bodies = pybullet.getCameraImage(
        width,
        height,
        view,
        lens,
        lightDirection=(sun_direction(light) * 100).tolist(),
        lightColor=(1, 1, 1),
        lightAmbientCoeff=(0.12 if light.sky == "night" else min(0.9, 0.62 * light.exposure)),
        lightDiffuseCoeff=0.45 * weather.sun[0] * light.exposure,
        lightSpecularCoeff=0.0,
        shadow=0,
        renderer=pybullet.ER_TINY_RENDERER,
        physicsClientId=uploaded.client,
    )
    return (
        np.asarray(rgba, np.uint8).reshape(height, width, 4)[..., :3],
        np.asarray(depth, np.float64).reshape(height, width),
        np.asarray(bodies, np.int64).reshape(height, width),
    )


def _sky(scene: SceneMesh, camera: Camera) -> NDArray[np.uint8]:
    """(H, W, 3) for a camera that looks up or down, (H, 1, 3) for a level one, where the middle column stands for all:
    by the height over the horizon."""
    weather = WEATHER[scene.light.sky]
    rise = (camera.cy_px - np.arange(camera.height) - 0.5)[:, None] / camera.fy_px
    if camera.pitch_deg:
        aside = (np.arange(camera.width) + 0.5 - camera.cx_px)[None, :] / camera.fx_px
        right, up, forward = view_axes(Pose(x=0.0, y=0.0, z=0.0, yaw=0.0), camera)
        rays = forward + aside[..., None] * right + rise[..., None] * up
        rise = rays[..., 2] / np.maximum(np.hypot(rays[..., 0], rays[..., 1]), 1e-9)
    rise = np.clip(rise, 0.0, None)
    high = (rise / np.sqrt(1 + rise**2))[..., None]
    share = 1 - (1 - high) ** 3
    colour = np.array(weather.horizon) * (1 - share) + np.array(weather.zenith) * share
    return np.asarray(np.rint(np.sqrt(colour) * 255), np.uint8)


def _through_air(scene: SceneMesh, picture: NDArray[np.uint8], metres: NDArray[np.float64]) -> NDArray[np.uint8]:
    """What fog and rain leave of a picture; the same picture in dry and clear air."""
    thick = extinction_per_m(scene.air)
    if thick == 0.0:
        return picture
    left = np.exp(-thick * metres)[..., None]
    linear = (picture / 255.0) ** 2 * left + np.array(airlight(scene.light)) * (1.0 - left)
    return np.asarray(np.rint(np.sqrt(linear) * 255), np.uint8)


def _with_movers(scene: SceneMesh) -> SceneMesh:
    """What moves, each about the origin, after all that stands still."""
    if not scene.moving:
        return scene
    shapes = [part.frames[0] for part in scene.moving]
    owners = [np.full(mesh.vertex_count, part.part) for mesh, part in zip(shapes, scene.moving, strict=True)]
    part_of = np.concatenate([scene.part_of, *owners]).astype(np.uint16)
    return replace(scene, mesh=concatenate([scene.mesh, *shapes]), part_of=part_of)


def _one_colour_per_face(scene: SceneMesh) -> SceneMesh:
    """The same triangles with corners of their own: between two colours lies no third one in a palette."""
    mesh = scene.mesh
    corners = mesh.faces.ravel()
    mean = mesh.colours[mesh.faces].astype(np.float64).mean(axis=1)
    own = Mesh(
        mesh.positions[corners],
        mesh.normals[corners],
        mesh.uv[corners],
        np.repeat((np.rint(mean / 4) * 4).clip(0, 255).astype(np.uint8), 3, axis=0),
        mesh.layer[corners],
        np.arange(len(corners), dtype=np.uint32).reshape(-1, 3),
    )
    return replace(scene, mesh=own, part_of=scene.part_of[corners])


def _atlas(scene: SceneMesh) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
    """One picture with every flat colour and every picture that the scene uses, and the uv (N, 2) into it."""
    mesh, textures = scene.mesh, scene.textures
    mean = np.array([p.reshape(-1, 3).mean(axis=0) / 255 for p in textures.images])
    pictures = _picture_vertices(scene)
    flat = np.rint(mesh.colours * mean[mesh.layer]).astype(np.uint32)
    code = (flat[:, 0] << 16) | (flat[:, 1] << 8) | flat[:, 2]
    palette, entry = np.unique(code, return_inverse=True)
    side = ceil(sqrt(len(palette)))
    atlas = np.zeros((_ATLAS, _ATLAS, 3), np.uint8)
    columns = _ATLAS // _CELL
    # a picture that is tinted (a painted door) has a cell for each rough tint
    tint = (mesh.colours >> 6).astype(np.int64) @ np.array([16, 4, 1]) + mesh.layer.astype(np.int64) * 64
    cells = np.unique(tint[pictures])
    rows = ceil(len(cells) / columns)
    # pictures from the top, then the palette as single pixels below them
    top = rows * _CELL
    width = min(_ATLAS, max(side, 1))
    x, y = entry % width, top + entry // width
    if len(palette) and int(y.max()) >= _ATLAS:
        raise ValueError(f"{len(palette)} colours and {len(cells)} pictures don't fit into the fallback's atlas")
    atlas[y, x] = flat
    uv = np.column_stack([(x + 0.5) / _ATLAS, (y + 0.5) / _ATLAS])
    for cell, code_of_tint in enumerate(cells):
        row, column = divmod(cell, columns)
        mine = pictures & (tint == code_of_tint)
        image = cv2.resize(textures.images[code_of_tint // 64], (_CELL, _CELL), interpolation=cv2.INTER_AREA)
        tinted = np.rint(image * (mesh.colours[mine].mean(axis=0) / 255)).astype(np.uint8)
        atlas[row * _CELL : (row + 1) * _CELL, column * _CELL : (column + 1) * _CELL] = tinted
        inset = 0.5 + np.clip(mesh.uv[mine], 0, 1) * (_CELL - 1)
        uv[mine] = np.column_stack([column * _CELL + inset[:, 0], (row + 1) * _CELL - inset[:, 1]]) / _ATLAS
    uv[:, 1] = 1 - uv[:, 1]
    return atlas, uv.astype(np.float32)


def _picture_vertices(scene: SceneMesh) -> NDArray[np.bool_]:
    """(N,) whether a vertex belongs to a picture: a layer that isn't tiled and isn't plain."""
    layer = scene.mesh.layer
    return np.asarray((scene.textures.tile_m[layer] == 1.0) & (layer != 0))
