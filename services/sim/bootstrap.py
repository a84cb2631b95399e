"""Settings in, the app out: the one place where the simulator's parts are chosen."""

from pathlib import Path
from threading import Lock, Thread

from fastapi import FastAPI

from contracts.scene import Scene
from episode_kit.limits import Limits
from service_kit.settings import BadSetting, revealed
from services.sim.app import build_app
from services.sim.catalogue import build, poster_layers
from services.sim.catalogue.extension import catalogue_with_extensions
from services.sim.catalogue.folder import with_own_things
from services.sim.episodes import Episodes
from services.sim.geometry.scene_mesh import SceneMesh, build_scene_mesh
from services.sim.geometry.textures import TextureSet, base_textures
from services.sim.render.choice import choose_renderer
from services.sim.render.gl import NoGlContext
from services.sim.render.thread import RenderThread
from services.sim.settings import SimSettings


def bootstrap(settings: SimSettings) -> FastAPI:
    """The app. Raises BadSetting where OpenGL is asked for and can't be had, or an extension of the catalogue or a
    folder of things is no good."""
    if settings.sim_things is not None:
        _take_in(settings.sim_things)
    catalogue = catalogue_with_extensions(_textures)
    limits = Limits(
        max_episodes=settings.sim_max_episodes,
        max_per_owner=settings.sim_max_episodes_per_owner,
        lease_s=settings.sim_lease_s,
        max_lease_s=settings.sim_max_lease_s,
        kept_scenes=settings.sim_kept_scenes,
    )
    try:
        renderer = RenderThread(lambda: choose_renderer(settings.sim_renderer))
    except NoGlContext as error:
        raise BadSetting(f"SIM_RENDERER={settings.sim_renderer}: {error}; choose auto or tiny") from None
    # drawn while the service starts and not when the first customer waits
    Thread(target=_textures, name="textures", daemon=True).start()
    episodes = Episodes(build_scene, renderer, limits, truth=settings.sim_truth)
    return build_app(episodes, renderer, catalogue, truth=settings.sim_truth, token=revealed(settings.sim_token))


def build_scene(scene: Scene) -> SceneMesh:
    """A scene of the catalogue's objects as triangles. Raises UnknownObject or ValueError."""
    return build_scene_mesh(scene, build, _textures())


_drawing = Lock()
_drawn: list[TextureSet] = []
"""One set for all scenes: the renderer keeps its copy of it once."""


def _textures() -> TextureSet:
    with _drawing:
        if not _drawn:
            _drawn.append(base_textures().with_pictures(poster_layers()))
        return _drawn[0]


def _take_in(folder: Path) -> None:
    """Classes and textures of one's own, before the first scene is built. Raises BadSetting."""
    textures = with_own_things(folder, _textures())
    with _drawing:
        _drawn[:] = [textures]
