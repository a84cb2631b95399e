"""How a street looks: light, weather, wall colours and shapes of things, by chance; some looks are never trained on.

Held out of training altogether, for measuring what the model does with what it has never met: concrete walls, dusk,
and things stretched or squeezed beyond `STRETCH`.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from contracts.cameras import Camera
from contracts.scene import CALM, Air, Building, Light, Scene
from contracts.sensor_profiles import PictureSensor, sensor_names, shipped_sensors
from evaluation.task_set.mixture import drawn
from evaluation.task_set.real_world import light_of, weather_of
from services.sim.geometry.mesh import Mesh
from services.sim.geometry.scene_mesh import ObjectBuilder
from services.sim.geometry.textures import TextureSet
from services.sim.sensors.picture import Motion, sensed_picture
from services.sim.sensors.rain import rained

TRAINED_SKIES = ("clear", "cloudy", "overcast")
TRAINED_LIGHT = {"day": 0.7, "night": 0.3}
TRAINED_WEATHER = {"dry": 0.65, "fog": 0.15, "rain": 0.2}
HELD_OUT_SKY = "dusk"
HELD_OUT_WALL = "concrete"
HELD_OUT_FAMILY = "grey_concrete"
STRETCH = 0.1
HELD_OUT_STRETCH = (0.18, 0.28)
_QUALITY = (60, 96)
_SLOW_PX_S = 40.0


def relit(scene: Scene, rng: np.random.Generator, *, held_out: bool = False) -> Scene:
    """The same street in other light and weather, with other wall colours."""
    sky = HELD_OUT_SKY if held_out else str(rng.choice(TRAINED_SKIES, p=(0.5, 0.3, 0.2)))
    light = Light.model_validate(
        {
            "sun_azimuth": float(rng.uniform(-np.pi, np.pi)),
            "sun_elevation": float(rng.uniform(0.35, 1.2)),
            "sky": sky,
            "exposure": float(rng.uniform(0.8, 1.2)),
        }
    )
    air = CALM
    if not held_out:
        light = light_of(light, drawn(TRAINED_LIGHT, rng), rng)
        air = Air(**weather_of(drawn(TRAINED_WEATHER, rng), rng))
    repaint = rng.random() < 0.5
    buildings = tuple(_repainted(b, rng, repaint, held_out) for b in scene.buildings)
    return scene.model_copy(update={"light": light, "air": air, "buildings": buildings})


def _repainted(building: Building, rng: np.random.Generator, repaint: bool, held_out: bool) -> Building:
    changes: dict[str, object] = {}
    if held_out:
        changes["wall"] = HELD_OUT_WALL
    elif building.style.wall == HELD_OUT_WALL:
        changes["wall"] = "plaster"
    if repaint:
        changes["wall_colour"] = _near(building.style.wall_colour, rng)
    return building.model_copy(update={"style": building.style.model_copy(update=changes)})


def _near(colour: str, rng: np.random.Generator) -> str:
    rgb = np.array([[[int(colour[i : i + 2], 16) for i in (1, 3, 5)]]], np.uint8)
    hsv = cv2.cvtColor(rgb, cv2.COLOR_RGB2HSV).astype(float)
    hsv += np.array([rng.uniform(-12, 12), rng.uniform(-25, 25), rng.uniform(-30, 20)])
    hsv = np.clip(hsv % (180, 1000, 1000), 0, (179, 255, 255)).astype(np.uint8)
    r, g, b = cv2.cvtColor(hsv, cv2.COLOR_HSV2RGB)[0, 0]
    return f"#{r:02x}{g:02x}{b:02x}"


def varied(build: ObjectBuilder, seed: int, *, held_out: bool = False) -> ObjectBuilder:
    """A catalogue whose shapes are a little wider, deeper or taller than the original's: one variant a class."""

    def variant(kind: str, colour: str, textures: TextureSet) -> Mesh:
        mesh = build(kind, colour, textures)
        rng = np.random.default_rng((seed, sum(kind.encode()), len(kind)))
        if held_out:
            grown = 1 + rng.uniform(*HELD_OUT_STRETCH, 3) * rng.choice((-1, 1), 3)
        elif rng.random() < 0.5:
            grown = 1 + rng.uniform(-STRETCH, STRETCH, 3)
        else:
            return mesh
        return mesh.transformed(scale=tuple(float(g) for g in grown))

    return variant


def camera_sensor(rng: np.random.Generator) -> PictureSensor:
    """One of the shipped profiles' colour cameras, with a picture quality by chance."""
    names = sensor_names()
    sensor = shipped_sensors(names[int(rng.integers(len(names)))]).picture
    return sensor.model_copy(update={"jpeg_quality": int(rng.integers(*_QUALITY))})


def photographed(
    rgb: NDArray[np.uint8], camera: Camera, sensor: PictureSensor, air: Air, rng: np.random.Generator
) -> NDArray[np.uint8]:
    """(H, W, 3) what that camera, which hovers, makes of a picture of dry air."""
    if air.rain_mm_h:
        rgb = rained(rgb, camera.fy_px, air.rain_mm_h, sensor.exposure_s, rng)
    return sensed_picture(rgb, camera, sensor, Motion(*rng.normal(0.0, _SLOW_PX_S, 2).tolist()), rng)
