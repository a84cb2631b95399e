"""One scene in the graphics memory: a vertex and an index buffer, its shadow map and its sky."""

from collections.abc import Mapping

import moderngl
import numpy as np

from services.sim.geometry.scene_mesh import SceneMesh
from services.sim.render.culling import Culler

SHADOW_SIZE = 4096
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
        vertices = np.zeros(mesh.vertex_count, _VERTEX)
        vertices["position"] = mesh.positions
        vertices["uv"] = mesh.uv / scene.textures.tile_m[mesh.layer][:, None]
        vertices["normal"] = np.rint(mesh.normals * 127) + 127
        vertices["colour"] = mesh.colours
        vertices["layer"] = mesh.layer
        vertices["part"] = scene.part_of
        self.scene = scene
        self.programs = programs
        self.textures = textures
        self.culler = Culler(scene)
        self._vertices = context.buffer(vertices.tobytes())
        self._indices = context.buffer(np.ascontiguousarray(mesh.faces, "<u4").tobytes())
        self.chosen = context.buffer(reserve=max(12, mesh.faces.size * 4), dynamic=True)
        surface = ("in_position", "in_uv", "in_normal", "in_colour", "in_layer")
        self.views = context.vertex_array(
            programs["scene"], [(self._vertices, "3f 2f 3f1 1x 3f1 1x 1u2 2x", *surface)], self.chosen
        )
        self.labelled = context.vertex_array(
            programs["labelled"], [(self._vertices, "3f 2f 3f1 1x 3f1 1x 1u2 1u2", *surface, "in_part")], self.chosen
        )
        self.shadow = context.vertex_array(
            programs["shadow"], [(self._vertices, "3f 20x", "in_position")], self._indices
        )
        self.ids = context.vertex_array(
            programs["ids"], [(self._vertices, "3f 18x 1u2", "in_position", "in_part")], self.chosen
        )
        self.shade = context.depth_texture((SHADOW_SIZE, SHADOW_SIZE))
        self.shade.compare_func = "<="
        self.shade.filter = (moderngl.LINEAR, moderngl.LINEAR)
        self.shade.repeat_x = self.shade.repeat_y = False

        self.panorama = context.texture(PANORAMA, 4)
        self.panorama.repeat_y = False

    def release(self) -> None:
        for thing in (
            self.panorama,
            self.views,
            self.labelled,
            self.shadow,
            self.ids,
            self.shade,
            self._vertices,
            self._indices,
            self.chosen,
        ):
            thing.release()
