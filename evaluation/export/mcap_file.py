"""MCAP with Foxglove's schemas: one file a flight, for Foxglove and whatever reads MCAP.

/drone/pose                foxglove.PoseInFrame, in frame `world` (ENU, metres)
/tf                        foxglove.FrameTransform: `drone` in `world`; every camera's optical frame in `drone`
/camera/NAME/image         foxglove.CompressedImage, the JPEG as the vehicle sent it
/camera/NAME/depth         foxglove.RawImage, 32FC1, metres along the optical axis: 0 is unknown, inf nothing in reach
/camera/NAME/calibration   foxglove.CameraCalibration
/camera/NAME/sightings     foxglove.ImageAnnotations: the boxes that the recognition model named
/action                    JSON `logisticsvln.Action`: the way to the next stop, and whether a window is claimed
/log                       foxglove.Log: the request, and what the mission said at each stop
"""

import json
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self

import numpy as np
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.Color_pb2 import Color
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.ImageAnnotations_pb2 import ImageAnnotations
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.Point2_pb2 import Point2
from foxglove_schemas_protobuf.PointsAnnotation_pb2 import PointsAnnotation
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from foxglove_schemas_protobuf.TextAnnotation_pb2 import TextAnnotation
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf.timestamp_pb2 import Timestamp
from mcap.well_known import MessageEncoding, SchemaEncoding
from mcap.writer import CompressionType, Writer
from mcap_protobuf.schema import register_schema

from contracts.cameras import Camera
from contracts.event_data import JudgedMatch
from contracts.images import INVALID, depth_in_metres
from evaluation.export.camera_frames import about_up, mounting
from evaluation.export.episodes import Episode, Step, View, read_episode
from evaluation.metrics.episode import EpisodeRecord
from evaluation.task_set.task import Task

WORLD, DRONE = "world", "drone"
ACTION_SCHEMA = {
    "title": "logisticsvln.Action",
    "description": "From this stop to the next, in the drone's own frame: metres ahead, left and up, radians turned "
    "counter-clockwise; the corners flown over, metres in the world; and whether a window is claimed from here.",
    "type": "object",
    "properties": {
        "step": {"type": "integer"},
        **{name: {"type": "number"} for name in ("forward_m", "left_m", "up_m", "turn_rad")},
        "claim": {"type": "boolean"},
        "path": {"type": "array", "items": {"type": "object"}},
    },
}
_NS = 1_000_000_000
_SEEN = Color(r=0.2, g=0.9, b=0.4, a=1.0)
_REJECTED = Color(r=0.9, g=0.5, b=0.2, a=1.0)


class McapWriter:
    """Writes `ID.mcap` of each flight into a folder. Every method may raise OSError."""

    def __init__(self, folder: Path, run: Path) -> None:
        self._folder = folder
        self._run = run

    def add(self, task: Task, record: EpisodeRecord) -> None:
        """One flight. Raises BadTrajectory where something of it is missing, before anything of it is written."""
        episode = read_episode(self._run, task, record)
        with _File(self._folder / f"{task.id}.mcap") as file:
            for topic, at_ns, message in _messages(episode):
                file.write(topic, at_ns, message)

    def finish(self) -> None:
        """Every file is whole."""

    def close(self) -> None:
        """Nothing is under way between two flights."""


class _Message(NamedTuple):
    """`content`: a Foxglove message, or the fields of an action."""

    topic: str
    at_ns: int
    content: Any


class _File:
    def __init__(self, path: Path) -> None:
        self._file = path.open("wb")
        self._writer = Writer(self._file, compression=CompressionType.ZSTD)
        self._writer.start(profile="", library="logisticsvln")
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}

    def write(self, topic: str, at_ns: int, content: Any) -> None:
        is_json = isinstance(content, dict)
        data = json.dumps(content).encode() if is_json else content.SerializeToString()
        if topic not in self._channels:
            schema = self._action_schema() if is_json else self._schema(content)
            encoding = MessageEncoding.JSON if is_json else MessageEncoding.Protobuf
            self._channels[topic] = self._writer.register_channel(topic, encoding, schema)
        self._writer.add_message(self._channels[topic], log_time=at_ns, publish_time=at_ns, data=data)

    def _schema(self, content: Any) -> int:
        name = content.DESCRIPTOR.full_name
        if name not in self._schemas:
            self._schemas[name] = register_schema(self._writer, type(content))
        return self._schemas[name]

    def _action_schema(self) -> int:
        data = json.dumps(ACTION_SCHEMA).encode()
        schema: int = self._writer.register_schema("logisticsvln.Action", SchemaEncoding.JSONSchema, data)
        return schema

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if kind is None:
                self._writer.finish()  # type: ignore[no-untyped-call]
        finally:
            self._file.close()


def _messages(episode: Episode) -> Iterator[_Message]:
    """A flight's, in the order of their time: nanoseconds since 1970, by when it began and the drone's clock."""
    began_ns = _began_ns(episode.record.started)
    yield _Message("/log", began_ns, _log(began_ns, episode.task.request))
    for camera in episode.cameras:
        yield _Message("/tf", began_ns, _mounted(camera, began_ns))
    for number, step in enumerate(episode.steps):
        at_ns = began_ns + round(step.time_s * _NS)
        yield from _at_stop(step, number, at_ns)


def _at_stop(step: Step, number: int, at_ns: int) -> Iterator[_Message]:
    pose = step.pose
    position = {"x": pose.x, "y": pose.y, "z": pose.z}
    turned = Quaternion(**about_up(pose.yaw)._asdict())
    there = Pose(position=Vector3(**position), orientation=turned)
    yield _Message("/drone/pose", at_ns, PoseInFrame(timestamp=_time(at_ns), frame_id=WORLD, pose=there))
    moved = FrameTransform(
        timestamp=_time(at_ns),
        parent_frame_id=WORLD,
        child_frame_id=DRONE,
        translation=Vector3(**position),
        rotation=turned,
    )
    yield _Message("/tf", at_ns, moved)
    for view in step.views():
        yield from _of_camera(view, at_ns)
        seen = [match for match in step.sightings if match.camera == view.camera.name]
        yield _Message(f"/camera/{view.camera.name}/sightings", at_ns, _boxes(seen, view.camera, at_ns))
    corners = [corner.model_dump() for corner in step.path]
    yield _Message("/action", at_ns, {"step": number, **step.motion._asdict(), "claim": step.claims, "path": corners})
    for said in step.said:
        yield _Message("/log", at_ns, _log(at_ns, said))


def _of_camera(view: View, at_ns: int) -> Iterator[_Message]:
    camera, topic, at = view.camera, f"/camera/{view.camera.name}", _time(at_ns)
    picture = CompressedImage(timestamp=at, frame_id=camera.name, data=view.jpeg, format="jpeg")
    yield _Message(f"{topic}/image", at_ns, picture)
    yield _Message(f"{topic}/calibration", at_ns, _calibration(camera, at_ns))
    if view.depth_units is None:
        return
    metres = depth_in_metres(view.depth_units, view.metres_per_unit)
    metres[view.depth_units == INVALID] = 0.0
    depth = RawImage(
        timestamp=at,
        frame_id=camera.name,
        width=camera.width,
        height=camera.height,
        encoding="32FC1",
        step=4 * camera.width,
        data=metres.astype("<f4").tobytes(),
    )
    yield _Message(f"{topic}/depth", at_ns, depth)


def _mounted(camera: Camera, at_ns: int) -> FrameTransform:
    there = mounting(camera)
    x, y, z = there.position
    return FrameTransform(
        timestamp=_time(at_ns),
        parent_frame_id=DRONE,
        child_frame_id=camera.name,
        translation=Vector3(x=x, y=y, z=z),
        rotation=Quaternion(**there.rotation._asdict()),
    )


def _calibration(camera: Camera, at_ns: int) -> CameraCalibration:
    projection = np.array([[camera.fx_px, 0.0, camera.cx_px], [0.0, camera.fy_px, camera.cy_px], [0.0, 0.0, 1.0]])
    return CameraCalibration(
        timestamp=_time(at_ns),
        frame_id=camera.name,
        width=camera.width,
        height=camera.height,
        distortion_model="plumb_bob",
        D=[0.0] * 5,
        K=projection.reshape(-1).tolist(),
        R=np.eye(3).reshape(-1).tolist(),
        P=np.hstack([projection, np.zeros((3, 1))]).reshape(-1).tolist(),
    )


def _boxes(matches: list[JudgedMatch], camera: Camera, at_ns: int) -> ImageAnnotations:
    at, drawn = _time(at_ns), ImageAnnotations(timestamp=_time(at_ns))
    for match in matches:
        box, colour = match.box, _REJECTED if match.rejected else _SEEN
        x0, x1 = box.x_min * camera.width, box.x_max * camera.width
        y0, y1 = box.y_min * camera.height, box.y_max * camera.height
        corners = [Point2(x=x, y=y) for x, y in ((x0, y0), (x1, y0), (x1, y1), (x0, y1))]
        outline = PointsAnnotation(
            timestamp=at, type=PointsAnnotation.LINE_LOOP, points=corners, outline_color=colour, thickness=2.0
        )
        drawn.points.append(outline)
        words = f"{match.confidence:.2f}" + (f" {match.rejected}" if match.rejected else "")
        drawn.texts.append(
            TextAnnotation(timestamp=at, position=corners[0], text=words, font_size=12.0, text_color=colour)
        )
    return drawn


def _log(at_ns: int, message: str) -> Log:
    return Log(timestamp=_time(at_ns), level=Log.INFO, message=message, name="mission")


def _time(at_ns: int) -> Timestamp:
    return Timestamp(seconds=at_ns // _NS, nanos=at_ns % _NS)


def _began_ns(started: str) -> int:
    """As `mission.record.now` writes it; 1970 where a record does not tell."""
    try:
        began = datetime.fromisoformat(started)
    except ValueError:
        return 0
    return round(began.astimezone(UTC).timestamp()) * _NS
