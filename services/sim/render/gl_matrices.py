"""The matrices and the sky's geometry that the OpenGL renderer draws with."""

import moderngl
import numpy as np
from numpy.typing import NDArray

from contracts.cameras import Camera
from services.sim.geometry.scene_mesh import SceneMesh
from services.sim.render.light import sun_direction
from services.sim.render.views import FAR_M, NEAR_M

SKY_SLOPES = (-0.05, 1.05)
"""What the painted sky spans: a level view of 90 degrees sees up to slope 1, straight ahead. For views that see higher
the sky is worked out pixel by pixel."""
SHADOW_HALF_M = 75.0


def sky_drum(sides: int = 96) -> NDArray[np.float32]:
    """(2 * sides + 2, 5): a strip round the eye, direction and uv of each corner; seen from inside."""
    share = np.repeat(np.arange(sides + 1) / sides, 2)
    angle = share * 2 * np.pi
    # downwards, beyond the painting, its lowest row goes on
    z = np.tile((-1.2, 1.2), sides + 1)
    v = (z - SKY_SLOPES[0]) / (SKY_SLOPES[1] - SKY_SLOPES[0])
    return np.column_stack([np.cos(angle), np.sin(angle), z, share, v]).astype("<f4")


def set_matrix(program: moderngl.Program, name: str, matrix: NDArray[np.float64]) -> None:
    """Hands a uniform its matrix."""
    uniform = program[name]
    assert isinstance(uniform, moderngl.Uniform)
    uniform.write(matrix.T.astype("<f4").tobytes())


def clip_matrix(axes: NDArray[np.float64], eye: NDArray[np.float64], camera: Camera) -> NDArray[np.float64]:
    """(4, 4) world to clip space, upside down, with the camera's frustum."""
    right, up, forward = axes
    across = (2 * camera.fx_px * right + (2 * camera.cx_px - camera.width) * forward) / camera.width
    down = ((2 * camera.cy_px - camera.height) * forward - 2 * camera.fy_px * up) / camera.height
    a = (FAR_M + NEAR_M) / (FAR_M - NEAR_M)
    b = -2 * FAR_M * NEAR_M / (FAR_M - NEAR_M)
    return np.array(
        [
            [*across, -across @ eye],
            [*down, -down @ eye],
            [*(a * forward), -a * (forward @ eye) + b],
            [*forward, -forward @ eye],
        ]
    )


def rays(axes: NDArray[np.float64], camera: Camera) -> NDArray[np.float64]:
    """(3, 3) from a picture's (x, y, 1), each -1..1, y downwards as it is drawn, to a direction in the world."""
    right, up, forward = axes
    across, down = camera.width / (2 * camera.fx_px), camera.height / (2 * camera.fy_px)
    off_x, off_y = (camera.width / 2 - camera.cx_px) / camera.fx_px, (camera.height / 2 - camera.cy_px) / camera.fy_px
    return np.column_stack([across * right, -down * up, forward + off_x * right - off_y * up])


def sun_matrix(scene: SceneMesh) -> NDArray[np.float64]:
    """(4, 4) world to the sun's square view of the part of the scene that matters: around `focus`."""
    sun = sun_direction(scene.light)
    side = np.cross((0.0, 0.0, 1.0), sun)
    side /= np.linalg.norm(side)
    up = np.cross(sun, side)
    focus = np.array(scene.focus, np.float64)
    h, reach = SHADOW_HALF_M, 250.0
    return np.array(
        [
            [*(side / h), -(side @ focus) / h],
            [*(up / h), -(up @ focus) / h],
            [*(-sun / reach), (sun @ focus) / reach],
            [0, 0, 0, 1],
        ]
    )
