"""The tables and the description of a LeRobot dataset: its features, data files and tasks."""

import json
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from contracts.cameras import Camera
from contracts.images import NO_RETURN

STATE = ("x_m", "y_m", "z_m", "yaw_rad")
ACTION = ("forward_m", "left_m", "up_m", "turn_rad", "claim")
FPS = 1

Feature = dict[str, Any]
Column = Sequence[Any] | NDArray[np.generic]


class DataFile:
    """A parquet file under way, a row group an episode."""

    def __init__(self, path: Path, number: int) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        self.number = number
        self.size = 0
        self._path = path
        self._writer: pq.ParquetWriter | None = None

    def add(self, columns: Mapping[str, Column]) -> None:
        table = pa.table({name: _arrow(values) for name, values in columns.items()})
        if self._writer is None:
            self._writer = pq.ParquetWriter(self._path, table.schema, compression="zstd")
        self._writer.write_table(table)
        self.size += table.nbytes

    def close(self) -> None:
        if self._writer is not None:
            self._writer.close()
            self._writer = None


def picture_key(camera: Camera) -> str:
    return f"observation.images.{camera.name}"


def depth_key(camera: Camera) -> str:
    return f"observation.images.{camera.name}_depth"


def features_of(cameras: Sequence[Camera], with_depth: Collection[str], units_m: float) -> dict[str, Feature]:
    """Every feature of the dataset. `with_depth`: the keys of the depth there is, in `units_m` metres a unit."""
    features: dict[str, Feature] = {
        "observation.state": _feature("float32", len(STATE), STATE),
        "action": _feature("float32", len(ACTION), ACTION),
        "flight_time_s": _feature("float32"),
        "next.reward": _feature("float32"),
        "next.done": _feature("bool"),
        "next.success": _feature("bool"),
        "timestamp": _feature("float32"),
        **{name: _feature("int64") for name in ("frame_index", "episode_index", "index", "task_index")},
    }
    for camera in cameras:
        features[picture_key(camera)] = _video_feature(camera)
        if depth_key(camera) in with_depth:
            features[depth_key(camera)] = _depth_feature(camera, units_m)
    return features


def _arrow(values: Column) -> pa.Array:
    if isinstance(values, np.ndarray) and values.ndim == 2:
        flat = pa.array(values.reshape(-1))
        return pa.FixedSizeListArray.from_arrays(flat, values.shape[1])
    if isinstance(values, np.ndarray):
        return pa.array(values)
    return pa.array(values, pa.struct([("bytes", pa.binary()), ("path", pa.string())]))


def _feature(dtype: str, width: int = 1, names: Sequence[str] | None = None) -> Feature:
    return {"dtype": dtype, "shape": [width], "names": list(names) if names else None}


def _video_feature(camera: Camera) -> Feature:
    info = {
        "video.height": camera.height,
        "video.width": camera.width,
        "video.codec": "av1",
        "video.pix_fmt": "yuv420p",
        "video.is_depth_map": False,
        "video.fps": FPS,
        "video.channels": 3,
        "has_audio": False,
        "camera": camera.model_dump(),
    }
    return {
        "dtype": "video",
        "shape": [camera.height, camera.width, 3],
        "names": ["height", "width", "channels"],
        "info": info,
    }


def _depth_feature(camera: Camera, units_m: float) -> Feature:
    info = {"is_depth_map": True, "depth_unit": "m", "unknown_m": 0.0, "no_return_m": NO_RETURN * units_m}
    return {
        "dtype": "image",
        "shape": [camera.height, camera.width, 1],
        "names": ["height", "width", "channels"],
        "info": info | {"metres_per_unit": units_m},
    }


def tasks_table(requests: Mapping[str, int]) -> pa.Table:
    """A table that pandas reads with the requests as its index, as LeRobot does."""
    table = pa.table({"task_index": pa.array(requests.values(), pa.int64()), "task": pa.array(requests, pa.string())})
    columns = [
        {"name": name, "field_name": name, "pandas_type": kind, "numpy_type": stored, "metadata": None}
        for name, kind, stored in (("task_index", "int64", "int64"), ("task", "unicode", "object"))
    ]
    pandas = {"index_columns": ["task"], "column_indexes": [], "columns": columns, "creator": {}, "pandas_version": "2"}
    return table.replace_schema_metadata({"pandas": json.dumps(pandas)})
