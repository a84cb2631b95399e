"""How a street looks: light, weather, wall colours and shapes of things, by chance; some looks are never trained on.

Held out of training altogether, for measuring what the model does with what it has never met: concrete walls, dusk,
and things stretched or squeezed beyond `STRETCH`.
"""

import cv2
import numpy as np

from contracts.scene import Building, Light, Scene
from services.sim.geometry.mesh import Mesh
from services.sim.geometry.scene_mesh import ObjectBuilder
from services.sim.geometry.textures import TextureSet

TRAINED_SKIES = ("clear", "cloudy", "overcast")
HELD_OUT_SKY = "dusk"
HELD_OUT_WALL = "concrete"
HELD_OUT_FAMILY = "grey_concrete"
STRETCH = 0.1
HELD_OUT_STRETCH = (0.18, 0.28)


def relit(scene: Scene, rng: np.random.Generator, *, held_out: bool = False) -> Scene:
    """The same street in other light, with other wall colours."""
    sky = HELD_OUT_SKY if held_out else str(rng.choice(TRAINED_SKIES, p=(0.5, 0.3, 0.2)))
    light = Light.model_validate(
        {
            "sun_azimuth": float(rng.uniform(-np.pi, np.pi)),
            "sun_elevation": float(rng.uniform(0.35, 1.2)),
            "sky": sky,
            "exposure": float(rng.uniform(0.8, 1.2)),
        }
    )
    repaint = rng.random() < 0.5
    buildings = tuple(_repainted(b, rng, repaint, held_out) for b in scene.buildings)
    return scene.model_copy(update={"light": light, "buildings": buildings})


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
