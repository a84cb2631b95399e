"""Pictures by OpenGL on EGL: on the processor where there is no graphics card, on the card where there is one."""

from collections.abc import Sequence
from typing import Literal

import cv2
import moderngl
import numpy as np
from numpy.typing import NDArray

from contracts.cameras import Camera
from contracts.geometry import Pose
from services.sim.geometry.scene_mesh import SceneMesh
from services.sim.geometry.textures import TextureSet
from services.sim.render.culling import Seen
from services.sim.render.gl_matrices import SKY_SLOPES, clip_matrix, rays, set_matrix, sky_drum, sun_matrix
from services.sim.render.gl_programs import Programs
from services.sim.render.gl_scene import GlScene
from services.sim.render.gl_weather import THICK_M, is_weathered, set_weather
from services.sim.render.glass import reflects, set_reflections
from services.sim.render.light import WEATHER, airlight, extinction_per_m, fill_direction, sun_direction
from services.sim.render.views import RenderedViews, check_cameras, eye_of, view_axes

_ROWS_AT_ONCE = 8192
_KEPT_TARGETS = 6


class NoGlContext(RuntimeError):
    """No OpenGL context can be had on this machine; the message says what EGL answered."""


class GlRenderer:
    """Bound to the thread that made it. Raises NoGlContext."""

    name: Literal["moderngl", "tiny"] = "moderngl"

    def __init__(self) -> None:
        try:
            self._gl = moderngl.create_context(standalone=True, require=430, backend="egl")  # type: ignore[arg-type]
        except Exception as error:
            raise NoGlContext(f"no EGL context with OpenGL 4.3: {str(error) or type(error).__name__}") from error
        info = self._gl.info
        self.detail = f"moderngl on {info['GL_RENDERER']}, OpenGL {self._gl.version_code / 100:.1f}"
        self._programs = Programs(self._gl)
        corners = self._gl.buffer(np.array([(-1, -1), (3, -1), (-1, 3)], "<f4").tobytes())
        self._panorama = self._gl.vertex_array(self._programs["panorama"], [(corners, "2f", "in_corner")])
        drum = self._gl.buffer(sky_drum().tobytes())
        self._skies = {
            what: self._gl.vertex_array(self._programs[program], [(drum, "3f 2f", "in_direction", "in_uv")])
            for what, program in (("scene", "sky"), ("labelled", "labelled_sky"))
        }
        self._domes = {
            what: self._gl.vertex_array(self._programs[program], [(corners, "2f", "in_corner")])
            for what, program in (("scene", "dome"), ("labelled", "labelled_dome"))
        }
        self._textures: dict[int, tuple[TextureSet, moderngl.TextureArray]] = {}
        self._targets: dict[tuple[int, int, int, bool], moderngl.Framebuffer] = {}

    def upload(self, scene: SceneMesh) -> GlScene:
        """Copies the scene into the renderer and draws its shadows and its sky once."""
        uploaded = GlScene(self._gl, self._programs.of(scene), scene, self._texture_array(scene.textures))
        self._draw_shadows(uploaded)
        self._draw_panorama(uploaded)
        return uploaded

    def render(
        self,
        uploaded: GlScene,
        pose: Pose,
        cameras: Sequence[Camera],
        time_s: float = 0.0,
        *,
        labelled: bool = False,
        panes: bool = False,
    ) -> RenderedViews:
        """Picture and depth of each camera, ids and panes where asked for. Raises ValueError beyond the limits."""
        self._place_movers(uploaded, pose, time_s, shadows=True)
        rgb: dict[int, NDArray[np.uint8]] = {}
        depth: dict[int, NDArray[np.uint16]] = {}
        ids: dict[int, NDArray[np.uint16]] = {}
        glass: dict[int, NDArray[np.bool_]] = {}
        for batch in _batches(cameras):
            chosen = [cameras[i] for i in batch]
            target = self._target(chosen, labelled)
            self._draw(uploaded, pose, chosen, target, "labelled" if labelled else "scene")
            shape = (len(batch), chosen[0].height, chosen[0].width)
            rgba = np.frombuffer(target.read(components=4, attachment=0), np.uint8).reshape(-1, chosen[0].width, 4)
            picture = np.asarray(cv2.cvtColor(rgba, cv2.COLOR_RGBA2RGB), np.uint8)
            rgb.update(zip(batch, picture.reshape(*shape, 3), strict=True))
            depth.update(zip(batch, _read(target, 1).reshape(shape), strict=True))
            if panes:
                glass.update(zip(batch, rgba[..., 3].reshape(shape) < 128, strict=True))
            if labelled:
                ids.update(zip(batch, _read(target, 2).reshape(shape), strict=True))
        order = range(len(cameras))
        return RenderedViews(
            tuple(rgb[i] for i in order),
            tuple(depth[i] for i in order),
            tuple(ids[i] for i in order) if labelled else None,
            tuple(glass[i] for i in order) if panes else None,
        )

    def render_ids(
        self, uploaded: GlScene, pose: Pose, cameras: Sequence[Camera], time_s: float = 0.0
    ) -> tuple[NDArray[np.uint16], ...]:
        """(H, W) ids of parts of each camera. Raises ValueError beyond the limits."""
        self._place_movers(uploaded, pose, time_s, shadows=False)
        ids: dict[int, NDArray[np.uint16]] = {}
        for batch in _batches(cameras):
            chosen = [cameras[i] for i in batch]
            target = self._target(chosen, False)
            self._draw(uploaded, pose, chosen, target, "ids")
            shape = (len(batch), chosen[0].height, chosen[0].width)
            ids.update(zip(batch, _read(target, 1).reshape(shape), strict=True))
        return tuple(ids[i] for i in range(len(cameras)))

    def close(self) -> None:
        """Gives everything back; uploaded scenes are gone with it."""
        self._gl.release()

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

    def _target(self, cameras: Sequence[Camera], labelled: bool) -> moderngl.Framebuffer:
        """One tall picture for cameras of one size, view under view, kept for the next call of the same shape."""
        width, height = cameras[0].width, cameras[0].height
        key = (width, height, len(cameras), labelled)
        if key not in self._targets:
            if len(self._targets) >= _KEPT_TARGETS:
                old = self._targets.pop(next(iter(self._targets)))
                for attachment in (*old.color_attachments, old.depth_attachment, old):
                    if attachment is not None:
                        attachment.release()
            shape = (width, height * len(cameras))
            whole = [self._gl.texture(shape, 1, dtype="u2") for _ in range(2 if labelled else 1)]
            self._targets[key] = self._gl.framebuffer(
                [self._gl.texture(shape, 4), *whole],
                self._gl.depth_renderbuffer(shape),
            )
        return self._targets[key]

    def _draw_shadows(self, uploaded: GlScene) -> None:
        target = self._gl.framebuffer(depth_attachment=uploaded.shade)
        self._begin_shadows(uploaded, target)
        uploaded.shadow.render()
        target.release()

    def _begin_shadows(self, uploaded: GlScene, target: moderngl.Framebuffer) -> None:
        """An empty map of shadows, ready to be drawn into."""
        target.use()
        target.scissor = (0, 0, target.width, target.height)
        target.clear(depth=1.0)
        # a rim without shadow, because everything beyond the map reads its rim
        target.scissor = (1, 1, target.width - 2, target.height - 2)
        self._gl.enable_only(moderngl.DEPTH_TEST)
        self._gl.depth_func = "<"
        set_matrix(self._programs["shadow"], "to_sun", sun_matrix(uploaded.scene))

    def _place_movers(self, uploaded: GlScene, pose: Pose, time_s: float, *, shadows: bool) -> None:
        if uploaded.moving is None:
            return
        uploaded.moving.place(time_s, pose)
        if shadows:
            self._begin_shadows(uploaded, uploaded.moving.shadow)
            uploaded.moving.cast()

    def _draw(
        self,
        uploaded: GlScene,
        pose: Pose,
        cameras: Sequence[Camera],
        target: moderngl.Framebuffer,
        what: Literal["scene", "labelled", "ids"],
    ) -> None:
        width, height = cameras[0].width, cameras[0].height
        target.use()
        target.viewport = (0, 0, width, height * len(cameras))
        target.clear()
        program = uploaded.programs[what]
        if what in self._skies:
            self._set_light(uploaded, program, self._skies[what].program)
        seen: dict[bytes, Seen] = {}  # mostly all cameras are in one place
        for i, camera in enumerate(cameras):
            axes, eye = view_axes(pose, camera), eye_of(pose, camera)
            if eye.tobytes() not in seen:
                seen[eye.tobytes()] = uploaded.culler.seen_from(eye)
            target.viewport = (0, i * height, width, height)
            self._gl.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
            # rows leave the card bottom first; the picture is drawn upside down instead, which turns the faces round
            self._gl.front_face = "cw"
            self._gl.depth_func = "<"
            set_matrix(program, "to_clip", clip_matrix(axes, eye, camera))
            if "eye" in program:
                program["eye"] = tuple(eye)
            uploaded.still.draw(what, seen[eye.tobytes()].towards(axes, camera))
            if uploaded.moving is not None:
                uploaded.moving.draw(what, eye, axes, camera)
            if what in self._skies:
                self._draw_sky(uploaded, axes, camera, what)

    def _draw_sky(self, uploaded: GlScene, axes: NDArray[np.float64], camera: Camera, what: str) -> None:
        """Where nothing was drawn: the scene's painted sky, or past its upper edge the sky itself."""
        self._gl.disable(moderngl.CULL_FACE)
        self._gl.depth_func = "<="
        if camera.pitch_deg == 0.0 and camera.cy_px / camera.fy_px < SKY_SLOPES[1]:
            set_matrix(self._skies[what].program, "to_clip", clip_matrix(axes, np.zeros(3), camera))
            self._skies[what].render(moderngl.TRIANGLE_STRIP)
            return
        dome = self._domes[what]
        self._set_sky(uploaded, dome.program)
        set_matrix(dome.program, "rays", rays(axes, camera))
        dome.render()

    def _set_light(self, uploaded: GlScene, scene: moderngl.Program, sky: moderngl.Program) -> None:
        light = uploaded.scene.light
        weather = WEATHER[light.sky]
        sun, gain = sun_direction(light), light.exposure
        uploaded.textures.use(0)
        uploaded.shade.use(1)
        uploaded.panorama.use(2)
        scene["surface"], scene["shade"], sky["panorama"] = 0, 1, 2
        if uploaded.moving is not None:
            uploaded.moving.shade.use(3)
            scene["moving_shade"] = 3
        set_matrix(scene, "to_sun", sun_matrix(uploaded.scene))
        scene["sun"] = tuple(sun)
        scene["fill_light"] = tuple(fill_direction(light))
        for name, value in (("sun_light", weather.sun), ("sky_light", weather.sky), ("ground_light", weather.ground)):
            scene[name] = tuple(gain * v for v in value)
        scene["haze"], scene["haze_per_m"] = weather.haze, weather.haze_per_m
        scene["pane_layers"] = uploaded.scene.textures.pane_layers
        if is_weathered(uploaded.scene):
            set_weather(scene, uploaded.scene)
        if reflects(light):
            set_reflections(scene, light)
            self._set_sky(uploaded, scene)

    def _draw_panorama(self, uploaded: GlScene) -> None:
        self._set_sky(uploaded, self._programs["panorama"])
        target = self._gl.framebuffer([uploaded.panorama])
        target.use()
        self._gl.enable_only(moderngl.NOTHING)
        self._panorama.render()
        target.release()

    def _set_sky(self, uploaded: GlScene, program: moderngl.Program) -> None:
        light = uploaded.scene.light
        for name in ("zenith", "horizon", "cloud", "cover", "glow"):
            program[name] = getattr(WEATHER[light.sky], name)
        program["sun"] = tuple(sun_direction(light))
        program["cloud_layer"] = float(uploaded.scene.textures.layer("clouds"))
        program["airlight"] = airlight(light)
        program["thickness"] = extinction_per_m(uploaded.scene.air) * THICK_M
        program["surface"] = 0
        if "slopes" in program:
            program["slopes"] = SKY_SLOPES
        uploaded.textures.use(0)


def _batches(cameras: Sequence[Camera]) -> list[list[int]]:
    """Which cameras are drawn together: those of one size, as many as one tall picture holds. Raises ValueError."""
    check_cameras(cameras)
    by_size: dict[tuple[int, int], list[int]] = {}
    for i, camera in enumerate(cameras):
        by_size.setdefault((camera.width, camera.height), []).append(i)
    batches = []
    for (_, height), alike in by_size.items():
        most = max(1, _ROWS_AT_ONCE // height)
        batches += [alike[at : at + most] for at in range(0, len(alike), most)]
    return batches


def _read(target: moderngl.Framebuffer, attachment: int) -> NDArray[np.uint16]:
    """The whole numbers of one attachment, flat."""
    return np.frombuffer(target.read(components=1, attachment=attachment, dtype="u2"), np.uint16)
