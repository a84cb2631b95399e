"""Draw streets into shards: `python -m training render`. Goes on where it stopped; several may run side by side.

Which seeds serve for what: 0-89,999 for fitting, 90,000-99,999 for validation (thresholds, calibration). Seeds from
100,000 up are never drawn here.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np

from contracts.cameras import Camera, pinhole_camera
from contracts.sensor_profiles import PictureSensor
from contracts.sim import Catalogue
from evaluation.scene_generator.scene_plan import UnbuildableScene
from services.sim.catalogue import CATALOGUE, build, poster_layers
from services.sim.geometry.scene_mesh import build_scene_mesh
from services.sim.geometry.textures import TextureSet, base_textures
from services.sim.render.gl import GlRenderer
from training.labels import Labeller, Labels
from training.looks import camera_sensor, photographed, varied
from training.shards import shard_path, write
from training.stops import CameraPose, looks
from training.streets import Street, street

FIT_SEEDS = range(90_000)
VALIDATION_SEEDS = range(90_000, 100_000)
SIZE_PX = 800
STOPS, FRONTAL = 7, 3
_PLAIN_QUALITY = 90


def kind_numbers(catalogue: Catalogue = CATALOGUE) -> dict[str, int]:
    return {entry.kind: i for i, entry in enumerate(catalogue.entries)}


def colour_numbers(catalogue: Catalogue = CATALOGUE) -> dict[str, int]:
    names = dict.fromkeys(c for entry in catalogue.entries for c in entry.colours)
    return {name: i for i, name in enumerate(names)}


def view_camera(heading_deg: float) -> Camera:
    """What the model is trained on: square pictures of 90 degrees, level."""
    return pinhole_camera("view", SIZE_PX, SIZE_PX, horizontal_fov_deg=90.0, heading_deg=heading_deg)


class Studio:
    """The renderer, the textures and the numbering, kept from street to street. Bound to its thread."""

    def __init__(self, catalogue: Catalogue = CATALOGUE) -> None:
        self._catalogue = catalogue
        self._gl = GlRenderer()
        self._textures: TextureSet = base_textures().with_pictures(poster_layers())
        self._kinds, self._colours = kind_numbers(catalogue), colour_numbers(catalogue)

    def shoot(
        self,
        place: Street,
        views: Sequence[CameraPose],
        rng: np.random.Generator,
        *,
        held_out: bool = False,
        plain: bool = False,
    ) -> tuple[list[bytes], list[Labels]]:
        """A JPEG and its labels for each view. `plain`: the catalogue's own shapes, a perfect camera and a good picture
        quality."""
        builder = build if plain else varied(build, place.scene.seed, held_out=held_out)
        mesh = build_scene_mesh(place.scene, builder, self._textures)
        labeller = Labeller(place.scene, mesh, self._kinds, self._colours)
        uploaded = self._gl.upload(mesh)
        sensor = PictureSensor(jpeg_quality=_PLAIN_QUALITY) if plain else camera_sensor(rng)
        jpegs, labels = [], []
        try:
            for look in views:
                camera = view_camera(look.heading_deg)
                seen = self._gl.render(uploaded, look.pose, [camera], labelled=True)
                assert seen.ids is not None
                rgb, ids = seen.rgb[0], seen.ids[0]
                if not plain:
                    rgb = photographed(rgb, camera, sensor, place.scene.air, rng)
                bgr = cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR)
                done, jpeg = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, sensor.jpeg_quality])
                assert done
                jpegs.append(jpeg.tobytes())
                labels.append(labeller.of(look.pose, camera, ids))
        finally:
            uploaded.release()
        return jpegs, labels

    def close(self) -> None:
        self._gl.close()


def render(
    folder: Path, seeds: Sequence[int], *, held_out: bool = False, sparse: bool | None = None, plain: bool = False
) -> Iterator[int]:
    """Draws what is not there yet; yields each seed when it is done or known to be unbuildable."""
    folder.mkdir(parents=True, exist_ok=True)
    studio = Studio()
    try:
        for seed in seeds:
            path = shard_path(folder, seed)
            if not path.exists():
                _one(studio, path, seed, held_out, sparse, plain)
            yield seed
    finally:
        studio.close()


def _one(studio: Studio, path: Path, seed: int, held_out: bool, sparse: bool | None, plain: bool) -> None:
    rng = np.random.default_rng((seed, 0x5407))
    try:
        place = street(CATALOGUE, seed, held_out=held_out, sparse=sparse)
    except UnbuildableScene:
        return
    views = looks(place, STOPS, FRONTAL, rng)
    jpegs, labels = studio.shoot(place, views, rng, held_out=held_out, plain=plain)
    write(path, seed, jpegs, labels, [v.frontal for v in views], place.crowded)
