"""The OpenGL programs, and which of them draw a scene."""

from collections.abc import Mapping

import moderngl

from services.sim.geometry.scene_mesh import SceneMesh
from services.sim.render import shaders
from services.sim.render.gl_weather import is_weathered


class Programs:
    """Those that every scene needs are made at once; those of streets with traffic when the first one comes."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._common = {
            "shadow": context.program(shaders.SHADOW_VERTEX, shaders.SHADOW_FRAGMENT),
            "panorama": context.program(shaders.PANORAMA_VERTEX, shaders.PANORAMA_FRAGMENT),
            "sky": context.program(shaders.SKY_VERTEX, shaders.SKY_FRAGMENT),
            "labelled_sky": context.program(shaders.SKY_VERTEX, shaders.LABELLED_SKY_FRAGMENT),
            "dome": context.program(shaders.DOME_VERTEX, shaders.DOME_FRAGMENT),
            "labelled_dome": context.program(shaders.DOME_VERTEX, shaders.LABELLED_DOME_FRAGMENT),
            "ids": context.program(shaders.IDS_VERTEX, shaders.IDS_FRAGMENT),
        }
        self._surfaces = {
            (False, False): self._pair(shaders.SCENE_VERTEX, shaders.SCENE_FRAGMENT),
            (True, False): self._pair(shaders.WEATHERED_VERTEX, shaders.WEATHERED_FRAGMENT),
        }

    def __getitem__(self, name: str) -> moderngl.Program:
        return self._common[name]

    def of(self, scene: SceneMesh) -> Mapping[str, moderngl.Program]:
        """Those by which the scene is drawn: `scene`, `labelled`, `ids` and `shadow` among them."""
        weathered, crowded = is_weathered(scene), bool(scene.moving)
        if (weathered, crowded) not in self._surfaces:
            vertex = shaders.WEATHERED_VERTEX if weathered else shaders.SCENE_VERTEX
            fragment = shaders.WEATHERED_FRAGMENT if weathered else shaders.SCENE_FRAGMENT
            self._surfaces[weathered, crowded] = self._pair(vertex, shaders.crowded_fragment(fragment))
        return self._common | self._surfaces[weathered, crowded]

    def _pair(self, vertex: str, fragment: str) -> dict[str, moderngl.Program]:
        labelled = shaders.labelled_vertex(vertex), shaders.labelled_fragment(fragment)
        return {"scene": self._context.program(vertex, fragment), "labelled": self._context.program(*labelled)}
