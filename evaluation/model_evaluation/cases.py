"""What the evaluation looks at: one fresh street a seed, and how its pictures and their truth are kept on disk.

A folder of pictures belongs to the renderer and the seeds, not to a model, so that models are compared on the same
pictures: `cases.jsonl` holds one Case a line, each written when all its pictures are on disk.
"""

from pathlib import Path
from typing import Literal, NamedTuple

from pydantic import ValidationError

from contracts.base import Metres, Name, Wire
from contracts.cameras import Camera
from contracts.geometry import Pose
from contracts.scene import BuildingKind, Scene, WindowPlace
from contracts.sim import Catalogue, TruthView
from evaluation.scene_generator.random_specs import random_spec
from evaluation.scene_generator.scenes import build_scene
from evaluation.task_set.requests import noun_phrase

FIRST_SEED = 100_000
"""Models are trained on the seeds below this, and their thresholds chosen there."""
STRANGE_SEED = 150_000
"""From here on streets that look as nothing in the training does."""
STRANGE_WALL: Literal["concrete"] = "concrete"
STRANGE_SKY: Literal["dusk"] = "dusk"
STRANGE_EXPOSURES = (0.65, 1.4)
CASES_FILE, CATALOGUE_FILE = "cases.jsonl", "catalogue.json"
SIZE = 800


class RenderedLook(Wire):
    """All views of one moment. `pictures` and `truth` in the order of `cameras`."""

    where: Literal["lap", "far", "near"]
    pose: Pose
    cameras: tuple[Camera, ...]
    pictures: tuple[str, ...]
    truth: tuple[TruthView, ...]


class Front(Wire):
    """One picture squarely before the starting facade. `number` counts bands from 1, 0 for the picture of the whole
    building; `facade_top_m` by depth, null where the top is out of sight; `stand_off_m` is measured."""

    number: int
    camera_m: Metres
    stand_off_m: Metres
    facade_top_m: float | None
    picture: str
    truth: TruthView


class Case(Wire):
    """One fresh street with its pictures. `object` is the goal's noun phrase; `strange` says that walls and light are
    ones that training leaves out; the rest says what the street is like."""

    seed: int
    object: str
    kind: Name
    colour: Name
    floor: int
    floors: int
    floor_height_m: Metres
    building: BuildingKind
    wall: str
    sky: str
    exposure: float
    strange: bool
    looks: tuple[RenderedLook, ...]
    fronts: tuple[Front, ...]


class Street(NamedTuple):
    """A scene of one seed, before anything is rendered."""

    scene: Scene
    object: str
    kind: str
    colour: str
    floor: int
    floor_height_m: float


def street(seed: int, catalogue: Catalogue) -> Street:
    """Raises evaluation.scene_generator.scene_plan.UnbuildableScene."""
    scene = build_scene(random_spec(catalogue, seed), seed, catalogue)
    if seed >= STRANGE_SEED:
        scene = _strange(scene)
    goal = next(o for o in scene.objects if o.id == scene.goal)
    assert isinstance(goal.place, WindowPlace)
    entry = next(e for e in catalogue.entries if e.kind == goal.kind)
    height_m = scene.building(scene.target).floor_height_m
    return Street(scene, noun_phrase(entry, goal.colour), goal.kind, goal.colour, goal.place.floor, height_m)


def _strange(scene: Scene) -> Scene:
    exposure = STRANGE_EXPOSURES[scene.seed % len(STRANGE_EXPOSURES)]
    light = scene.light.model_copy(update={"sky": STRANGE_SKY, "exposure": exposure})
    bare = [b.model_copy(update={"style": b.style.model_copy(update={"wall": STRANGE_WALL})}) for b in scene.buildings]
    return scene.model_copy(update={"light": light, "buildings": tuple(bare)})


def read_cases(folder: Path) -> dict[int, Case]:
    """The whole cases of a folder by seed; a line that a crash cut off is left out."""
    cases: dict[int, Case] = {}
    try:
        lines = (folder / CASES_FILE).read_text(encoding="utf-8").splitlines()
    except FileNotFoundError:
        return cases
    for line in lines:
        try:
            case = Case.model_validate_json(line)
        except ValidationError:
            continue
        cases[case.seed] = case
    return cases
