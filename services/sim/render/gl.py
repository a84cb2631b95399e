"""Pictures by OpenGL on EGL: on the processor where there is no graphics card, on the card where there is one."""

from collections.abc import Sequence
from typing import Literal

import cv2
import moderngl
import numpy as np
from numpy.typing import NDArray

from contracts.geometry import Pose
from services.sim.geometry.scene_mesh import SceneMesh
from services.sim.geometry.textures import TextureSet
from services.sim.render import shaders
from services.sim.render.gl_scene import SHADOW_SIZE, GlScene
from services.sim.render.light import WEATHER, fill_direction, sun_direction
from services.sim.render.views import FAR_M, NEAR_M, RenderedViews, view_axes

SKY_SLOPES = (-0.05, 1.05)
"""What the painted sky spans: a level view of 90 degrees sees up to slope 1, straight ahead."""
SHADOW_HALF_M = 75.0


class NoGlContext(RuntimeError):
    """No OpenGL context can be had on this machine; the message says what EGL answered."""


class GlRenderer:
    """`max_size` bounds a view's side, `max_views` how many are drawn at once. Bound to the thread that made it.

    Raises NoGlContext.
    """

    name: Literal["moderngl", "tiny"] = "moderngl"

    def __init__(self, max_size: int = 1600, max_views: int = 5) -> None:
        try:
            self._gl = moderngl.create_context(standalone=True, require=430, backend="egl")  # type: ignore[arg-type]
        except Exception as error:
            raise NoGlContext(f"no EGL context with OpenGL 4.3: {str(error) or type(error).__name__}") from error
        info = self._gl.info
        self.detail = f"moderngl on {info['GL_RENDERER']}, OpenGL {self._gl.version_code / 100:.1f}"
        self._max_size, self._max_views = max_size, max_views
        self._programs = {
            "scene": self._gl.program(shaders.SCENE_VERTEX, shaders.SCENE_FRAGMENT),
            "shadow": self._gl.program(shaders.SHADOW_VERTEX, shaders.SHADOW_FRAGMENT),
            "panorama": self._gl.program(shaders.PANORAMA_VERTEX, shaders.PANORAMA_FRAGMENT),
            "sky": self._gl.program(shaders.SKY_VERTEX, shaders.SKY_FRAGMENT),
            "labelled": self._gl.program(shaders.LABELLED_VERTEX, shaders.LABELLED_FRAGMENT),
            "labelled_sky": self._gl.program(shaders.SKY_VERTEX, shaders.LABELLED_SKY_FRAGMENT),
            "ids": self._gl.program(shaders.IDS_VERTEX, shaders.IDS_FRAGMENT),
        }
        corners = self._gl.buffer(np.array([(-1, -1), (3, -1), (-1, 3)], "<f4").tobytes())
        self._panorama = self._gl.vertex_array(self._programs["panorama"], [(corners, "2f", "in_corner")])
        drum = self._gl.buffer(_sky_drum().tobytes())
        self._skies = {
            what: self._gl.vertex_array(self._programs[program], [(drum, "3f 2f", "in_direction", "in_uv")])
            for what, program in (("scene", "sky"), ("labelled", "labelled_sky"))
        }
        self._textures: dict[int, tuple[TextureSet, moderngl.TextureArray]] = {}
        self._targets: dict[tuple[int, int, bool], moderngl.Framebuffer] = {}

    def upload(self, scene: SceneMesh) -> GlScene:
        """Copies the scene into the renderer and draws its shadows and its sky once."""
        uploaded = GlScene(self._gl, self._programs, scene, self._texture_array(scene.textures))
        self._draw_shadows(uploaded)
        self._draw_panorama(uploaded)
        return uploaded

    def render(
        self, uploaded: GlScene, pose: Pose, headings_deg: Sequence[float], size: int, *, labelled: bool = False
    ) -> RenderedViews:
        """Pictures and depth of each view, ids where asked for. Raises ValueError beyond the limits."""
        self._check(headings_deg, size)
        v = len(headings_deg)
        target = self._target(size, v, labelled)
        self._draw(uploaded, pose, headings_deg, size, target, "labelled" if labelled else "scene")
        rgba = np.frombuffer(target.read(components=4, attachment=0), np.uint8).reshape(v * size, size, 4)
        rgb = np.asarray(cv2.cvtColor(rgba, cv2.COLOR_RGBA2RGB), np.uint8).reshape(v, size, size, 3)
        depth = np.frombuffer(target.read(components=1, attachment=1, dtype="u2"), np.uint16)
        ids = np.frombuffer(target.read(components=1, attachment=2, dtype="u2"), np.uint16) if labelled else None
        shape = (v, size, size)
        return RenderedViews(rgb, depth.reshape(shape), ids.reshape(shape) if ids is not None else None)

    def render_ids(self, uploaded: GlScene, pose: Pose, headings_deg: Sequence[float], size: int) -> NDArray[np.uint16]:
        """(V, H, W) ids of parts. Raises ValueError beyond the limits."""
        self._check(headings_deg, size)
        target = self._target(size, len(headings_deg), False)
        self._draw(uploaded, pose, headings_deg, size, target, "ids")
        ids = np.frombuffer(target.read(components=1, attachment=1, dtype="u2"), np.uint16)
        return ids.reshape(len(headings_deg), size, size)

    def close(self) -> None:
        """Gives everything back; uploaded scenes are gone with it."""
        self._gl.release()

    def _check(self, headings_deg: Sequence[float], size: int) -> None:
        if not 1 <= size <= self._max_size or not 1 <= len(headings_deg) <= self._max_views:
            raise ValueError(
                f"asked for {len(headings_deg)} views of {size} px; 1..{self._max_views} views "
                f"of 1..{self._max_size} px can be drawn"
            )

    def _texture_array(self, textures: TextureSet) -> moderngl.TextureArray:
        known = self._textures.get(id(textures))
        if known is not None:
            return known[1]
        layers, height, width, _ = textures.images.shape
        pixels = np.full((layers, height, width, 4), 255, np.uint8)
        pixels[..., :3] = textures.images[:, ::-1]
        array = self._gl.texture_array((width, height, layers), 4, pixels.tobytes())
        array.build_mipmaps()
        # blending between mip levels as well costs a quarter more in software and hardly shows
        array.filter = (moderngl.LINEAR_MIPMAP_NEAREST, moderngl.LINEAR)
        self._textures[id(textures)] = (textures, array)
        return array

    def _target(self, size: int, views: int, labelled: bool) -> moderngl.Framebuffer:
        """One tall picture, view under view, kept for the next call of the same shape."""
        key = (size, views, labelled)
        if key not in self._targets:
            if len(self._targets) >= 4:
                old = self._targets.pop(next(iter(self._targets)))
                for attachment in (*old.color_attachments, old.depth_attachment, old):
                    if attachment is not None:
                        attachment.release()
            shape = (size, size * views)
            whole = [self._gl.texture(shape, 1, dtype="u2") for _ in range(2 if labelled else 1)]
            self._targets[key] = self._gl.framebuffer(
                [self._gl.texture(shape, 4), *whole],
                self._gl.depth_renderbuffer(shape),
            )
        return self._targets[key]

    def _draw_shadows(self, uploaded: GlScene) -> None:
        target = self._gl.framebuffer(depth_attachment=uploaded.shade)
        target.use()
        target.clear(depth=1.0)
        # a rim without shadow, because everything beyond the map reads its rim
        target.scissor = (1, 1, SHADOW_SIZE - 2, SHADOW_SIZE - 2)
        self._gl.enable_only(moderngl.DEPTH_TEST)
        _set_matrix(self._programs["shadow"], "to_sun", _sun_matrix(uploaded.scene))
        uploaded.shadow.render()
        target.release()

    def _draw(
        self,
        uploaded: GlScene,
        pose: Pose,
        headings_deg: Sequence[float],
        size: int,
        target: moderngl.Framebuffer,
        what: Literal["scene", "labelled", "ids"],
    ) -> None:
        target.use()
        target.viewport = (0, 0, size, size * len(headings_deg))
        target.clear()
        program, sky = self._programs[what], self._skies.get(what)
        if sky is not None:
            self._set_light(uploaded, program, sky.program)
        vertices = {"scene": uploaded.views, "labelled": uploaded.labelled, "ids": uploaded.ids}[what]
        eye = np.array([pose.x, pose.y, pose.z])
        seen = uploaded.culler.seen_from(eye)
        for i, heading in enumerate(headings_deg):
            axes = view_axes(pose, heading)
            target.viewport = (0, i * size, size, size)
            self._gl.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
            # rows leave the card bottom first; the picture is drawn upside down instead, which turns the faces round
            self._gl.front_face = "cw"
            self._gl.depth_func = "<"
            _set_matrix(program, "to_clip", _clip_matrix(axes, eye))
            faces = seen.towards(axes)
            if len(faces):
                uploaded.chosen.write(faces.data)
                vertices.render(vertices=faces.size)
            if sky is not None:
                self._gl.disable(moderngl.CULL_FACE)
                self._gl.depth_func = "<="
                _set_matrix(sky.program, "to_clip", _clip_matrix(axes, np.zeros(3)))
                sky.render(moderngl.TRIANGLE_STRIP)

    def _set_light(self, uploaded: GlScene, scene: moderngl.Program, sky: moderngl.Program) -> None:
        light = uploaded.scene.light
        weather = WEATHER[light.sky]
        sun, gain = sun_direction(light), light.exposure
        uploaded.textures.use(0)
        uploaded.shade.use(1)
        uploaded.panorama.use(2)
        scene["surface"], scene["shade"], sky["panorama"] = 0, 1, 2
        _set_matrix(scene, "to_sun", _sun_matrix(uploaded.scene))
        scene["sun"] = tuple(sun)
        scene["fill_light"] = tuple(fill_direction(light))
        for name, value in (("sun_light", weather.sun), ("sky_light", weather.sky), ("ground_light", weather.ground)):
            scene[name] = tuple(gain * v for v in value)
        scene["haze"], scene["haze_per_m"] = weather.haze, weather.haze_per_m

    def _draw_panorama(self, uploaded: GlScene) -> None:
        light = uploaded.scene.light
        program = self._programs["panorama"]
        for name in ("zenith", "horizon", "cloud", "cover", "glow"):
            program[name] = getattr(WEATHER[light.sky], name)
        program["sun"] = tuple(sun_direction(light))
        program["cloud_layer"] = float(uploaded.scene.textures.layer("clouds"))
        program["slopes"], program["surface"] = SKY_SLOPES, 0
        uploaded.textures.use(0)
        target = self._gl.framebuffer([uploaded.panorama])
        target.use()
        self._gl.enable_only(moderngl.NOTHING)
        self._panorama.render()
        target.release()


def _sky_drum(sides: int = 96) -> NDArray[np.float32]:
    """(2 * sides + 2, 5): a strip round the eye, direction and uv of each corner; seen from inside."""
    share = np.repeat(np.arange(sides + 1) / sides, 2)
    angle = share * 2 * np.pi
    # downwards, beyond the painting, its lowest row goes on
    z = np.tile((-1.2, 1.2), sides + 1)
    v = (z - SKY_SLOPES[0]) / (SKY_SLOPES[1] - SKY_SLOPES[0])
    return np.column_stack([np.cos(angle), np.sin(angle), z, share, v]).astype("<f4")


def _set_matrix(program: moderngl.Program, name: str, matrix: NDArray[np.float64]) -> None:
    uniform = program[name]
    assert isinstance(uniform, moderngl.Uniform)
    uniform.write(matrix.T.astype("<f4").tobytes())


def _clip_matrix(axes: NDArray[np.float64], eye: NDArray[np.float64]) -> NDArray[np.float64]:
    """(4, 4) world to clip space, upside down, with a 90-degree frustum."""
    right, up, forward = axes
    a = (FAR_M + NEAR_M) / (FAR_M - NEAR_M)
    b = -2 * FAR_M * NEAR_M / (FAR_M - NEAR_M)
    return np.array(
        [
            [*right, -right @ eye],
            [*-up, up @ eye],
            [*(a * forward), -a * (forward @ eye) + b],
            [*forward, -forward @ eye],
        ]
    )


def _sun_matrix(scene: SceneMesh) -> NDArray[np.float64]:
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
