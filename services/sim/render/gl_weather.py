"""What the OpenGL renderer draws with after dark, in fog and in rain."""

import moderngl
import numpy as np

from services.sim.geometry.scene_mesh import SceneMesh
from services.sim.render.light import (
    LAMP_LIGHT,
    MOST_LAMPS,
    WEATHER,
    airlight,
    extinction_per_m,
    window_lights,
)
from services.sim.render.shaders import MOST_PANES

THICK_M = 300.0
"""How thick the layer of fog or rain over the street is."""


def is_weathered(scene: SceneMesh) -> bool:
    """Whether windows or lamps give light, or the air takes it away: all others are drawn as ever."""
    return scene.light.lamps_burn or extinction_per_m(scene.air) > 0.0


def set_weather(program: moderngl.Program, scene: SceneMesh) -> None:
    """Hands the weathered program the scene's lights and air. Raises ValueError for more kinds of panes than it
    holds."""
    first, last = scene.textures.pane_layers
    panes = last - first + 1
    if panes > MOST_PANES:
        raise ValueError(f"{panes} kinds of window panes; the renderer lights up to {MOST_PANES}")
    windows = np.zeros((MOST_PANES, 3))
    windows[:panes] = window_lights(scene.light, panes, scene.seed)
    _array(program, "window_light", windows)
    lamps = scene.lamps if scene.light.lamps_burn else scene.lamps[:0]
    nearest = lamps[np.argsort(np.linalg.norm(lamps - np.array(scene.focus), axis=1), kind="stable")[:MOST_LAMPS]]
    program["lamp_count"] = len(nearest)
    _array(program, "lamps", np.concatenate([nearest, np.zeros((MOST_LAMPS - len(nearest), 3))]))
    program["lamp_light"] = tuple(scene.light.exposure * part for part in LAMP_LIGHT)
    thick = extinction_per_m(scene.air)
    if thick:
        program["haze"], program["haze_per_m"] = airlight(scene.light), thick
    else:
        program["haze_per_m"] = WEATHER[scene.light.sky].haze_per_m


def _array(program: moderngl.Program, name: str, values: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> None:
    uniform = program[name]
    assert isinstance(uniform, moderngl.Uniform)
    uniform.write(values.astype("<f4").tobytes())
