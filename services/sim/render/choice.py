"""Which renderer draws here, and why."""

from typing import Literal

from services.sim.render.gl import GlRenderer, NoGlContext
from services.sim.render.views import Renderer

Preference = Literal["auto", "moderngl", "tiny"]


def choose_renderer(preference: Preference = "auto") -> Renderer:
    """OpenGL where a context can be had, TinyRenderer otherwise; `detail` of the result says why.

    Raises NoGlContext where `moderngl` is asked for and can't be had.
    """
    if preference == "tiny":
        return _tiny("asked for by the settings")
    try:
        return GlRenderer()
    except NoGlContext as error:
        if preference == "moderngl":
            raise
        return _tiny(str(error))


def _tiny(reason: str) -> Renderer:
    # PyBullet prints to stdout when it is imported: only where it is needed
    from services.sim.render.tiny import TinyRenderer

    return TinyRenderer(reason)
