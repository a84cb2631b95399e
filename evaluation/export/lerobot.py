"""LeRobotDataset v3.0: one frame a stop, one episode a flight.

meta/info.json, meta/stats.json, meta/tasks.parquet, meta/episodes/   what there is, and its statistics
data/      states, actions, and depth: float32 TIFF in metres, lossless; 0 is unknown, `no_return_m` nothing in reach
videos/    the cameras' pictures, a film a camera, AV1

Steps do not come at even times, and LeRobot's frames do: `fps` is 1, `timestamp` counts stops, and `flight_time_s` is
what the drone's clock said.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from contracts.cameras import Camera
from evaluation.bench.folder import read_settings
from evaluation.export.episodes import CannotExport, Episode, read_episode
from evaluation.export.lerobot_statistics import Statistics, of_all, of_depth, of_pictures, of_vectors
from evaluation.export.lerobot_tables import (
    FPS,
    Column,
    DataFile,
    depth_key,
    features_of,
    picture_key,
    tasks_table,
)
from evaluation.export.lerobot_video import VIDEO_MB, FilmWriter, Placed
from evaluation.metrics.episode import EpisodeRecord
from evaluation.task_set.task import Task
from mission.trajectory import BadTrajectory

FILES_A_CHUNK, DATA_MB = 1000, 100
DATA_PATH = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
VIDEO_PATH = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
EPISODES_PATH = "meta/episodes/chunk-000/file-000.parquet"
_DEFLATE = [cv2.IMWRITE_TIFF_COMPRESSION, 8]
_Pictures = dict[str, list[NDArray[np.uint8]]]
_Depths = dict[str, list[NDArray[np.uint16]]]


class _Rows(NamedTuple):
    """One episode's columns of the data files, and the statistics of every feature."""

    columns: dict[str, Column]
    statistics: dict[str, Statistics]


class LeRobotWriter:
    """Writes into a folder. Every method may raise OSError."""

    def __init__(self, folder: Path, run: Path) -> None:
        self._folder = folder
        self._run = run
        self._robot = f"logisticsvln-{read_settings(run).mission.rig.name}"
        self._cameras: tuple[Camera, ...] = ()
        self._films: dict[str, FilmWriter] = {}
        self._requests: dict[str, int] = {}
        self._episodes: list[dict[str, Any]] = []
        self._statistics: list[dict[str, Statistics]] = []
        self._frames = 0
        self._units_m = 0.0
        self._data: DataFile | None = None

    def add(self, task: Task, record: EpisodeRecord) -> None:
        """One flight. Raises BadTrajectory where something of it is missing, before anything of it is written;
        CannotExport where its cameras are others than those before."""
        episode = read_episode(self._run, task, record)
        self._same_cameras(episode)
        number, count = len(self._episodes), len(episode.steps)
        pictures, depths = self._seen(episode)
        request = self._requests.setdefault(task.request, len(self._requests))
        rows = self._rows(episode, number, request, pictures, depths)
        places = {key: film.add(pictures[key]) for key, film in self._films.items()}
        file = self._write(rows.columns, number)
        self._episodes.append(
            {
                "episode_index": number,
                "tasks": [task.request],
                "length": count,
                "data/chunk_index": 0,
                "data/file_index": file,
                "dataset_from_index": self._frames,
                "dataset_to_index": self._frames + count,
                **_places(places),
                **_flat(rows.statistics),
                "meta/episodes/chunk_index": 0,
                "meta/episodes/file_index": 0,
                "task_id": task.id,
                "outcome": record.result.outcome if record.result is not None else record.reason,
                "success": record.success,
            }
        )
        self._statistics.append(rows.statistics)
        self._frames += count

    def close(self) -> None:
        """Ends the files under way."""
        for film in self._films.values():
            film.close()
        if self._data is not None:
            self._data.close()

    def finish(self) -> None:
        """Writes what is known only in the end."""
        self.close()
        meta = self._folder / "meta"
        (meta / "episodes" / "chunk-000").mkdir(parents=True, exist_ok=True)
        pq.write_table(pa.Table.from_pylist(self._episodes), self._folder / EPISODES_PATH)
        pq.write_table(tasks_table(self._requests), meta / "tasks.parquet")
        features = features_of(self._cameras, self._statistics[0], self._units_m)
        totals = {name: of_all([episode[name] for episode in self._statistics]) for name in features}
        (meta / "stats.json").write_text(json.dumps({n: _lists(t) for n, t in totals.items()}, indent=1), "utf-8")
        info = {
            "codebase_version": "v3.0",
            "robot_type": self._robot,
            "total_episodes": len(self._episodes),
            "total_frames": self._frames,
            "total_tasks": len(self._requests),
            "chunks_size": FILES_A_CHUNK,
            "data_files_size_in_mb": DATA_MB,
            "video_files_size_in_mb": VIDEO_MB,
            "fps": FPS,
            "splits": {"train": f"0:{len(self._episodes)}"},
            "data_path": DATA_PATH,
            "video_path": VIDEO_PATH,
            "features": features,
        }
        (meta / "info.json").write_text(json.dumps(info, indent=1), "utf-8")

    def _same_cameras(self, episode: Episode) -> None:
        if not self._cameras:
            self._cameras = episode.cameras
            for camera in self._cameras:
                key = picture_key(camera)
                self._films[key] = FilmWriter(self._folder, key, VIDEO_PATH, camera.width, camera.height, FPS)
        elif episode.cameras != self._cameras:
            raise CannotExport(
                f"{episode.task.id} was flown with other cameras than the flights before: export it apart"
            )

    def _seen(self, episode: Episode) -> tuple[_Pictures, _Depths]:
        """Pictures and depth of all steps, by the names of their features. Raises BadTrajectory."""
        pictures: _Pictures = {key: [] for key in self._films}
        depths: _Depths = {}
        for step in episode.steps:
            for view in step.views():
                pictures[picture_key(view.camera)].append(_rgb(view.jpeg))
                if view.depth_units is not None:
                    depths.setdefault(depth_key(view.camera), []).append(view.depth_units)
                    self._units_m = view.metres_per_unit
        return pictures, depths

    def _rows(self, episode: Episode, number: int, request: int, pictures: _Pictures, depths: _Depths) -> _Rows:
        steps, count = episode.steps, len(episode.steps)
        ended = np.arange(count) == count - 1
        columns: dict[str, Column] = {
            "observation.state": np.array([tuple(s.pose.model_dump().values()) for s in steps], np.float32),
            "action": np.array([(*step.motion, float(step.claims)) for step in steps], np.float32),
            "flight_time_s": np.array([step.time_s for step in steps], np.float32),
            "next.reward": (ended & episode.record.success).astype(np.float32),
            "next.done": ended,
            "next.success": ended & episode.record.success,
            "timestamp": (np.arange(count) / FPS).astype(np.float32),
            "frame_index": np.arange(count),
            "episode_index": np.full(count, number),
            "index": np.arange(self._frames, self._frames + count),
            "task_index": np.full(count, request),
        }
        statistics = {name: of_vectors(np.asarray(values)) for name, values in columns.items()}
        for name, maps in depths.items():
            statistics[name] = of_depth(maps, self._units_m)
            columns[name] = [{"bytes": tiff(depth, self._units_m), "path": None} for depth in maps]
        statistics |= {key: of_pictures(frames) for key, frames in pictures.items()}
        return _Rows(columns, statistics)

    def _write(self, columns: Mapping[str, Column], number: int) -> int:
        """Into the data file under way, or a new one where that is full; which it is."""
        if self._data is None or self._data.size > DATA_MB * 1024 * 1024:
            file = 0 if self._data is None else self._data.number + 1
            if self._data is not None:
                self._data.close()
            self._data = DataFile(self._folder / DATA_PATH.format(chunk_index=0, file_index=file), file)
        self._data.add(columns)
        return self._data.number


def tiff(units: NDArray[np.uint16], metres_per_unit: float) -> bytes:
    """Depth as float32 metres. Dividing by `metres_per_unit` and rounding gives the units back."""
    ok, data = cv2.imencode(".tiff", units.astype(np.float32) * np.float32(metres_per_unit), _DEFLATE)
    if not ok:
        raise CannotExport("the depth could not be encoded as TIFF")
    return data.tobytes()


def _rgb(jpeg: bytes) -> NDArray[np.uint8]:
    bgr = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
    if bgr is None:
        raise BadTrajectory("a picture could not be decoded")
    return np.ascontiguousarray(bgr[:, :, ::-1])


def _places(places: Mapping[str, Placed]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, place in places.items():
        found[f"videos/{key}/chunk_index"] = 0
        found[f"videos/{key}/file_index"] = place.file
        found[f"videos/{key}/from_timestamp"] = place.from_s
        found[f"videos/{key}/to_timestamp"] = place.to_s
    return found


def _flat(statistics: Mapping[str, Statistics]) -> dict[str, Any]:
    return {f"stats/{name}/{part}": value for name, s in statistics.items() for part, value in _lists(s).items()}


def _lists(statistics: Statistics) -> dict[str, Any]:
    counts = {"count": [int(statistics["count"][0])]}
    return {name: value.tolist() for name, value in statistics.items() if name != "count"} | counts
