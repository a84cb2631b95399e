"""The OpenGL programs, and which of them draw a scene."""

from collections.abc import Mapping
from typing import NamedTuple

import moderngl

from services.sim.geometry.scene_mesh import SceneMesh
from services.sim.render import shaders
from services.sim.render.gl_weather import is_weathered
from services.sim.render.glass import reflecting_fragment, reflects


class _Kind(NamedTuple):
    """What is in the pictures besides a clear day's street."""

    weathered: bool
    crowded: bool = False
    reflecting: bool = False


class Programs:
    """Those that most scenes need are made at once; those of traffic and of panes that reflect when the first comes."""

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
            _Kind(weathered=False): self._pair(shaders.SCENE_VERTEX, shaders.SCENE_FRAGMENT),
            _Kind(weathered=True): self._pair(shaders.WEATHERED_VERTEX, shaders.WEATHERED_FRAGMENT),
        }

    def __getitem__(self, name: str) -> moderngl.Program:
        return self._common[name]

    def of(self, scene: SceneMesh) -> Mapping[str, moderngl.Program]:
        """Those by which the scene is drawn: `scene`, `labelled`, `ids` and `shadow` among them."""
        kind = _Kind(is_weathered(scene), bool(scene.moving), reflects(scene.light))
        if kind not in self._surfaces:
            places = kind.weathered or kind.reflecting
            vertex = shaders.WEATHERED_VERTEX if places else shaders.SCENE_VERTEX
            fragment = shaders.WEATHERED_FRAGMENT if kind.weathered else shaders.SCENE_FRAGMENT
            if kind.reflecting:
                fragment = reflecting_fragment(fragment)
            if kind.crowded:
                fragment = shaders.crowded_fragment(fragment)
            self._surfaces[kind] = self._pair(vertex, fragment)
        return self._common | self._surfaces[kind]

    def _pair(self, vertex: str, fragment: str) -> dict[str, moderngl.Program]:
        labelled = shaders.labelled_vertex(vertex), shaders.labelled_fragment(fragment)
        return {"scene": self._context.program(vertex, fragment), "labelled": self._context.program(*labelled)}
