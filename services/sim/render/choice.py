"""Which renderer draws here, and why."""

from typing import Literal

from services.sim.render.gl import GlRenderer, NoGlContext
from services.sim.render.views import Renderer

Preference = Literal["auto", "moderngl", "tiny"]


def choose_renderer(preference: Preference = "auto", max_size: int = 1600, max_views: int = 5) -> Renderer:
    """OpenGL where a context can be had, TinyRenderer otherwise; `detail` of the result says why.

    Raises NoGlContext where `moderngl` is asked for and can't be had.
    """
    if preference == "tiny":
        return _tiny("asked for by the settings", max_size, max_views)
    try:
        return GlRenderer(max_size, max_views)
    except NoGlContext as error:
        if preference == "moderngl":
            raise
        return _tiny(str(error), max_size, max_views)


def _tiny(reason: str, max_size: int, max_views: int) -> Renderer:
    # PyBullet prints to stdout when it is imported: only where it is needed
    from services.sim.render.tiny import TinyRenderer

    return TinyRenderer(reason, max_size, max_views)
