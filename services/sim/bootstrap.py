"""Settings of the simulator, and the one place where its parts are chosen.

`SIM_RENDERER` (auto | moderngl | tiny), `SIM_MAX_EPISODES`, `SIM_IDLE_S`, `SIM_KEPT_SCENES`, `SIM_TRUTH` (on | off),
`SIM_TOKEN`; `HOST`, `PORT` and `LOG_LEVEL` as for every service. All optional.
"""

from functools import cache
from threading import Lock, Thread
from typing import cast, get_args

from fastapi import FastAPI

from contracts.scene import Scene
from service_kit.settings import Settings
from services.sim.app import build_app
from services.sim.catalogue import CATALOGUE, build, poster_layers
from services.sim.episodes import Episodes, Limits
from services.sim.geometry.scene_mesh import SceneMesh, build_scene_mesh
from services.sim.geometry.textures import TextureSet, base_textures
from services.sim.render.choice import Preference, choose_renderer
from services.sim.render.thread import RenderThread

DEFAULT_PORT = 8104


def bootstrap(settings: Settings) -> FastAPI:
    """The app. Raises BadSetting, and NoGlContext where OpenGL is asked for and can't be had."""
    preference = cast(Preference, settings.choice("SIM_RENDERER", "auto", get_args(Preference)))
    limits = Limits(
        max_episodes=settings.integer("SIM_MAX_EPISODES", 16, 1, 500),
        idle_s=settings.number("SIM_IDLE_S", 900.0, 1.0, 86_400.0),
        kept_scenes=settings.integer("SIM_KEPT_SCENES", 4, 0, 100),
    )
    truth = settings.flag("SIM_TRUTH")
    renderer = RenderThread(lambda: choose_renderer(preference))
    # drawn while the service starts and not when the first customer waits
    Thread(target=_textures, name="textures", daemon=True).start()
    episodes = Episodes(build_scene, renderer, limits, truth=truth)
    return build_app(episodes, renderer, CATALOGUE, truth=truth, token=settings.text("SIM_TOKEN"))


def build_scene(scene: Scene) -> SceneMesh:
    """A scene of the catalogue's objects as triangles. Raises UnknownObject or ValueError."""
    return build_scene_mesh(scene, build, _textures())


_drawing = Lock()


def _textures() -> TextureSet:
    with _drawing:
        return _drawn_textures()


@cache
def _drawn_textures() -> TextureSet:
    # one set for all scenes: the renderer keeps its copy of it once
    return base_textures().with_pictures(poster_layers())
