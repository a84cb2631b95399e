"""COCO: the boxes that the recognition model named, over the pictures that it was shown.

annotations.json   images, annotations and categories, as https://cocodataset.org/#format-data has them; a box has the
                   model's confidence as `score`, so that `annotations` alone are a file of results as well
images/ID/...      the pictures, as the model got them

Every picture shown for the object is listed, whether the object was seen in it or not. With the `oracle` the boxes are
the truth (of what is looked for, as far as it counts as seen), with any other model its answers.
"""

import json
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from contracts.cameras import Camera
from contracts.event_data import LookedView
from contracts.events import LookEvent
from contracts.geometry import Box
from contracts.images import BadImage, image_header
from contracts.vlm_gateway import Match
from evaluation.bench.folder import read_settings
from evaluation.export.episodes import Found, find_flights
from evaluation.metrics.episode import EpisodeRecord
from evaluation.task_set.task import Task
from mission.record import read_events
from mission.trajectory import BadTrajectory

Document = dict[str, Any]


class ShownPicture(NamedTuple):
    """One picture of a look, and what the model named in it."""

    file: Path
    camera: Camera
    exploration_step: int
    matches: tuple[Match, ...]


def with_pictures(run: Path, *, only_successes: bool = False) -> Found:
    """The tasks of a run whose pictures were kept. Raises BadFolder, CannotExport where there is none."""

    def lacks(task: Task, _: EpisodeRecord) -> str | None:
        kept = (run / "episodes" / task.id / "events.jsonl").is_file()
        return None if kept else "flown without --pictures all"

    return find_flights(run, lacks, only_successes, "pictures", "`logisticsvln bench --pictures all` keeps them")


class CocoWriter:
    """Writes into a folder. Every method may raise OSError."""

    def __init__(self, folder: Path, run: Path) -> None:
        self._folder = folder
        self._run = run
        settings = read_settings(run)
        self._backend = settings.backend
        self._description = f"{settings.tasks} flown with {settings.backend}: what it named in what it was shown"
        self._images: list[Document] = []
        self._annotations: list[Document] = []
        self._categories: dict[str, Document] = {}

    def add(self, task: Task, record: EpisodeRecord) -> None:
        """One flight. Raises BadTrajectory where a picture is missing or damaged; then nothing of it is kept."""
        pictures = list(shown(self._run, task))
        category = self._category(task)
        for picture in pictures:
            name = f"images/{task.id}/{picture.file.name}"
            (self._folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(picture.file, self._folder / name)
            image = {
                "id": len(self._images) + 1,
                "file_name": name,
                "width": picture.camera.width,
                "height": picture.camera.height,
                "task": task.id,
                "request": task.request,
                "object": task.object,
                "camera": picture.camera.name,
                "exploration_step": picture.exploration_step,
            }
            self._images.append(image)
            for match in picture.matches:
                self._annotations.append(
                    {
                        "id": len(self._annotations) + 1,
                        "image_id": image["id"],
                        "category_id": category,
                        **_in_pixels(match.box, picture.camera),
                        "iscrowd": 0,
                        "score": match.confidence,
                    }
                )

    def close(self) -> None:
        """Nothing is under way between two flights."""

    def finish(self) -> None:
        """Writes the annotations."""
        document: Document = {
            "info": {"description": self._description, "annotator": self._backend},
            "licenses": [],
            "images": self._images,
            "annotations": self._annotations,
            "categories": list(self._categories.values()),
        }
        (self._folder / "annotations.json").write_text(json.dumps(document, ensure_ascii=False), encoding="utf-8")

    def _category(self, task: Task) -> int:
        kind = task.object_kind
        if kind not in self._categories:
            number = len(self._categories) + 1
            self._categories[kind] = {"id": number, "name": kind, "supercategory": task.category}
        return int(self._categories[kind]["id"])


def shown(run: Path, task: Task) -> Iterator[ShownPicture]:
    """Every picture of a flight that was shown for the object. Raises BadTrajectory."""
    folder = run / "episodes" / task.id
    for event in read_events(folder):
        if isinstance(event, LookEvent):
            for view in event.data.views:
                yield _shown(folder / "pictures", event, view, event.data.answer.matches)


def _shown(folder: Path, event: LookEvent, view: LookedView, matches: Sequence[Match]) -> ShownPicture:
    name = event.picture(view.picture)
    if name is None:
        raise BadTrajectory(f"{folder.parent}: event {event.number} names no picture of camera {view.camera.name}")
    try:
        header = image_header((folder / name).read_bytes())
    except OSError as error:
        raise BadTrajectory(f"{folder / name}: {error.strerror}") from None
    except BadImage as error:
        raise BadTrajectory(f"{folder / name}: {error}") from None
    if (header.width, header.height) != (view.camera.width, view.camera.height):
        raise BadTrajectory(f"{folder / name} is not as large as its camera's pictures")
    own = tuple(match for match in matches if match.camera == view.camera.name)
    return ShownPicture(folder / name, view.camera, event.data.exploration_step, own)


def _in_pixels(box: Box, camera: Camera) -> Document:
    """x, y, width and height from the top left; and the area, as there is no finer outline."""
    x, y = box.x_min * camera.width, box.y_min * camera.height
    width, height = box.x_max * camera.width - x, box.y_max * camera.height - y
    return {"bbox": [round(value, 2) for value in (x, y, width, height)], "area": round(width * height, 2)}
