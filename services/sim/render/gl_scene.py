"""One scene in the graphics memory: what stands still, what moves, its shadow map and its sky."""

from collections.abc import Mapping

import moderngl
import numpy as np
from numpy.typing import NDArray

from contracts.cameras import Camera
from contracts.geometry import Pose
from services.sim.geometry.mesh import Mesh, concatenate
from services.sim.geometry.scene_mesh import SceneMesh
from services.sim.geometry.textures import TextureSet
from services.sim.render.culling import Culler, inside

SHADOW_SIZE = 4096
MOVING_SHADOW_SIZE = 2048
"""Drawn anew for each look."""
PANORAMA = (2048, 512)
_VERTEX = np.dtype(
    [
        ("position", "<f4", 3),
        ("uv", "<f4", 2),
        ("normal", "u1", 3),
        ("_pad1", "u1"),
        ("colour", "u1", 3),
        ("_pad2", "u1"),
        ("layer", "<u2"),
        ("part", "<u2"),
    ]
)


class Arrays:
    """Triangles in the graphics memory as each program takes them; `chosen` says which are drawn."""

    def __init__(
        self,
        context: moderngl.Context,
        programs: Mapping[str, moderngl.Program],
        vertices: moderngl.Buffer,
        chosen: moderngl.Buffer,
    ) -> None:
        self.vertices = vertices
        self.chosen = chosen
        surface = ("in_position", "in_uv", "in_normal", "in_colour", "in_layer")
        self._of = {
            "scene": context.vertex_array(
                programs["scene"], [(vertices, "3f 2f 3f1 1x 3f1 1x 1u2 2x", *surface)], chosen
            ),
            "labelled": context.vertex_array(
                programs["labelled"], [(vertices, "3f 2f 3f1 1x 3f1 1x 1u2 1u2", *surface, "in_part")], chosen
            ),
            "ids": context.vertex_array(programs["ids"], [(vertices, "3f 18x 1u2", "in_position", "in_part")], chosen),
            "shadow": context.vertex_array(programs["shadow"], [(vertices, "3f 20x", "in_position")], chosen),
        }

    def draw(self, what: str, faces: NDArray[np.uint32]) -> None:
        """faces: (M, 3)."""
        if len(faces):
            self.chosen.write(faces.data)
            self._of[what].render(vertices=faces.size)

    def release(self) -> None:
        for array in self._of.values():
            array.release()
        self.vertices.release()
        self.chosen.release()


class GlScene:
    """One scene in the graphics memory. Shares its texture array with every scene of the same texture set."""

    def __init__(
        self,
        context: moderngl.Context,
        programs: Mapping[str, moderngl.Program],
        scene: SceneMesh,
        textures: moderngl.TextureArray,
    ) -> None:
        mesh = scene.mesh
        self.scene = scene
        self.programs = programs
        self.textures = textures
        self.culler = Culler(scene)
        vertices = context.buffer(vertices_of(mesh, scene.part_of, scene.textures).tobytes())
        self._indices = context.buffer(np.ascontiguousarray(mesh.faces, "<u4").tobytes())
        chosen = context.buffer(reserve=max(12, mesh.faces.size * 4), dynamic=True)
        self.still = Arrays(context, programs, vertices, chosen)
        self.moving = GlMovers(context, programs, scene) if scene.moving else None
        self.shadow = context.vertex_array(programs["shadow"], [(vertices, "3f 20x", "in_position")], self._indices)
        self.shade = shadow_map(context, SHADOW_SIZE)
        self.panorama = context.texture(PANORAMA, 4)
        self.panorama.repeat_y = False

    def release(self) -> None:
        for thing in (self.panorama, self.shadow, self.shade, self._indices):
            thing.release()
        self.still.release()
        if self.moving is not None:
            self.moving.release()


class GlMovers:
    """What moves in one scene, put where it is before each look."""

    def __init__(self, context: moderngl.Context, programs: Mapping[str, moderngl.Program], scene: SceneMesh) -> None:
        self._parts, self._textures = scene.moving, scene.textures
        largest = [max(part.frames, key=lambda mesh: mesh.vertex_count) for part in scene.moving]
        vertices = sum(mesh.vertex_count for mesh in largest)
        faces = sum(max(mesh.triangle_count for mesh in part.frames) for part in scene.moving)
        self._arrays = Arrays(
            context,
            programs,
            context.buffer(reserve=vertices * _VERTEX.itemsize, dynamic=True),
            context.buffer(reserve=faces * 12, dynamic=True),
        )
        self.shade = shadow_map(context, MOVING_SHADOW_SIZE)
        self.shadow = context.framebuffer(depth_attachment=self.shade)
        self._low = self._high = np.zeros((0, 3))
        self._faces: list[NDArray[np.uint32]] = []

    def place(self, time_s: float, pose: Pose) -> None:
        """As they stand at that time, about a drone at `pose`."""
        drone = np.array((pose.x, pose.y, pose.z))
        meshes = [part.mesh(time_s, drone) for part in self._parts]
        owners = [
            np.full(mesh.vertex_count, part.part, np.uint16) for mesh, part in zip(meshes, self._parts, strict=True)
        ]
        bounds = np.array([mesh.bounds for mesh in meshes], np.float64)
        self._low, self._high = bounds[:, 0], bounds[:, 1]
        firsts = np.cumsum([0, *(mesh.vertex_count for mesh in meshes[:-1])]).astype(np.uint32)
        self._faces = [mesh.faces + first for mesh, first in zip(meshes, firsts, strict=True)]
        vertices = vertices_of(concatenate(meshes), np.concatenate(owners), self._textures)
        self._arrays.vertices.write(vertices.tobytes())

    def cast(self) -> None:
        """All of them, into whatever shadow map is drawn now."""
        self._arrays.draw("shadow", np.concatenate(self._faces))

    def draw(self, what: str, eye: NDArray[np.float64], axes: NDArray[np.float64], camera: Camera) -> None:
        """Those that the camera's picture may show."""
        shown = np.flatnonzero(inside(self._low, self._high, eye, axes, camera))
        if len(shown):
            self._arrays.draw(what, np.concatenate([self._faces[k] for k in shown]))

    def release(self) -> None:
        self._arrays.release()
        self.shadow.release()
        self.shade.release()


def shadow_map(context: moderngl.Context, size: int) -> moderngl.Texture:
    """A square depth texture that answers how much of the sun a place sees."""
    shade = context.depth_texture((size, size))
    shade.compare_func = "<="
    shade.filter = (moderngl.LINEAR, moderngl.LINEAR)
    shade.repeat_x = shade.repeat_y = False
    return shade


def vertices_of(mesh: Mesh, part_of: NDArray[np.uint16], textures: TextureSet) -> NDArray[np.void]:
    """(N,) as the programs read them."""
    vertices = np.zeros(mesh.vertex_count, _VERTEX)
    vertices["position"] = mesh.positions
    vertices["uv"] = mesh.uv / textures.tile_m[mesh.layer][:, None]
    vertices["normal"] = np.rint(mesh.normals * 127) + 127
    vertices["colour"] = mesh.colours
    vertices["layer"] = mesh.layer
    vertices["part"] = part_of
    return vertices
