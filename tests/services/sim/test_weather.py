"""Fog, rain and night in the pictures of both renderers; dry and clear days are drawn as ever."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from contracts.cameras import default_rig
from contracts.geometry import Pose
from contracts.scene import Air, Light, Scene
from services.sim.bootstrap import build_scene
from services.sim.render.choice import choose_renderer
from services.sim.render.light import extinction_per_m, window_lights
from services.sim.render.views import RenderedViews, Renderer
from tests.services.sim.conftest import build_boxes, make_yard

CAMERAS = tuple(c for c in default_rig().scaled_to(160).cameras if c.name in ("front", "right"))
BEFORE_THE_HOUSE = Pose(x=0.0, y=-15.0, z=5.0, yaw=float(np.pi / 2))


@pytest.fixture(scope="module", params=["moderngl", "tiny"])
def renderer(request: pytest.FixtureRequest) -> Iterator[Renderer]:
    made = choose_renderer(request.param)
    yield made
    made.close()


def drawn(renderer: Renderer, *, labelled: bool = False, boxes: bool = True, **changes: object) -> RenderedViews:
    scene = make_yard(**changes)
    if boxes:
        mesh = replace(build_boxes(scene), air=scene.air)
    else:
        mesh = build_scene(scene.model_copy(update={"objects": (), "goal": None}))
    uploaded = renderer.upload(mesh)
    try:
        return renderer.render(uploaded, BEFORE_THE_HOUSE, CAMERAS, labelled=labelled)
    finally:
        uploaded.release()


def test_fog_takes_contrast_and_leaves_depth_as_it_is(renderer: Renderer) -> None:
    clear = drawn(renderer, light=Light(sky="overcast"))
    thin, thick = (drawn(renderer, light=Light(sky="overcast"), air=Air(visibility_m=v)) for v in (100.0, 25.0))
    far = [views.rgb[1][60:90].astype(float).std() for views in (clear, thin, thick)]
    assert far[0] > far[1] > far[2]
    assert np.array_equal(clear.depth_units[0], thick.depth_units[0])


def test_the_night_is_dark(renderer: Renderer) -> None:
    day, night = drawn(renderer), drawn(renderer, light=Light(sky="night"))
    assert 0.0 < night.rgb[0].mean() < 0.35 * day.rgb[0].mean()


def test_lit_windows_are_brighter_than_the_wall_about_them_and_ids_stay() -> None:
    gl = choose_renderer("moderngl")
    try:
        dark, lit = (
            drawn(gl, labelled=True, boxes=False, light=Light(sky="night", lit_windows=share)) for share in (0.0, 1.0)
        )
    finally:
        gl.close()
    assert dark.rgb[0].max() < 120
    assert (lit.rgb[0].max(axis=2) > 120).mean() > 0.01
    assert dark.ids is not None
    assert lit.ids is not None
    assert np.array_equal(dark.ids[0], lit.ids[0])


def test_extinction_is_that_of_the_visibility_and_of_the_rain() -> None:
    assert np.exp(-extinction_per_m(Air(visibility_m=200.0)) * 200.0) == pytest.approx(0.05)
    # 25 mm an hour cost 9.3 dB a kilometre
    assert extinction_per_m(Air(rain_mm_h=25.0)) * 4343.0 == pytest.approx(9.3, abs=0.05)
    assert extinction_per_m(Air()) == 0.0


def test_the_share_of_lit_windows_is_kept() -> None:
    for share in (0.0, 0.25, 1.0):
        lights = window_lights(Light(sky="night", lit_windows=share), 12, seed=5)
        assert (lights.sum(axis=1) > 0).mean() == pytest.approx(share, abs=0.05)
    assert not np.array_equal(
        window_lights(Light(lit_windows=0.5), 12, 1), window_lights(Light(lit_windows=0.5), 12, 2)
    )


def test_scenes_without_weather_are_written_as_they_always_were(yard: Scene) -> None:
    assert "air" not in yard.model_dump_json()
    assert "lit_windows" not in yard.model_dump_json()
    foggy = Scene.model_validate(yard.model_dump() | {"air": {"visibility_m": 50.0}})
    assert Scene.model_validate_json(foggy.model_dump_json()) == foggy
