"""Rerun: one `.rrd` a flight, to be looked at with `rerun ID.rrd`.

world/drone                      where it is; world/way the way flown, world/buildings the scene's outlines
world/drone/CAMERA               where the camera is and how it projects
world/drone/CAMERA/image         the JPEG as the vehicle sent it
world/drone/CAMERA/depth         uint16 as the vehicle sent it, with its metres per unit; 65535 is nothing in reach
world/drone/CAMERA/sightings     the boxes that the recognition model named
request, log                     what the customer said, what the mission said at each stop
action/...                       the way to the next stop in the drone's own frame, and whether a window is claimed

Timelines: `step` counts stops, `flight` is the drone's clock.
"""

import errno
from pathlib import Path

import numpy as np
import rerun as rr

from contracts.cameras import Camera
from contracts.event_data import JudgedMatch
from contracts.scene import Scene
from contracts.scene_layout import floor_outline, wall_height_m
from evaluation.export.camera_frames import about_up, mounting
from evaluation.export.episodes import Episode, Step, View, read_episode
from evaluation.metrics.episode import EpisodeRecord
from evaluation.task_set.task import Task

DRONE = "world/drone"


class RerunWriter:
    """Writes `ID.rrd` of each flight into a folder. Every method may raise OSError."""

    def __init__(self, folder: Path, run: Path) -> None:
        self._folder = folder
        self._run = run

    def add(self, task: Task, record: EpisodeRecord) -> None:
        """One flight. Raises BadTrajectory where something of it is missing, before anything of it is written."""
        episode = read_episode(self._run, task, record)
        with rr.RecordingStream("logisticsvln", recording_id=task.id) as stream:
            # not by its own sink to a file, which keeps to itself that a disk was full at the end
            written = rr.binary_stream(recording=stream)
            _log_flight(stream, episode)
            data = written.read()
        if data is None:
            raise OSError(errno.EIO, "nothing was encoded", f"{task.id}.rrd")
        (self._folder / f"{task.id}.rrd").write_bytes(data)

    def finish(self) -> None:
        """Every file is whole."""

    def close(self) -> None:
        """Nothing is under way between two flights."""


def _log_flight(stream: rr.RecordingStream, episode: Episode) -> None:
    stream.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    stream.log("request", rr.TextDocument(episode.task.request), static=True)
    _log_buildings(stream, episode.task.scene)
    for camera in episode.cameras:
        _log_mounting(stream, camera)
    way = [[step.pose.x, step.pose.y, step.pose.z] for step in episode.steps]
    stream.log("world/way", rr.LineStrips3D([_corners(episode.steps)], radii=0.05), static=True)
    stream.log("world/stops", rr.Points3D(way, radii=0.12), static=True)
    for number, step in enumerate(episode.steps):
        stream.set_time("step", sequence=number)
        stream.set_time("flight", duration=step.time_s)
        _log_stop(stream, step)


def _log_stop(stream: rr.RecordingStream, step: Step) -> None:
    pose = step.pose
    turned = rr.Quaternion(xyzw=about_up(pose.yaw))
    stream.log(DRONE, rr.Transform3D(translation=[pose.x, pose.y, pose.z], quaternion=turned))
    for view in step.views():
        _log_view(stream, view)
        seen = [match for match in step.sightings if match.camera == view.camera.name]
        _log_sightings(stream, view.camera, seen)
    for name, value in step.motion._asdict().items():
        stream.log(f"action/{name}", rr.Scalars(value))
    stream.log("action/claim", rr.Scalars(float(step.claims)))
    for said in step.said:
        stream.log("log", rr.TextLog(said))


def _log_view(stream: rr.RecordingStream, view: View) -> None:
    place = f"{DRONE}/{view.camera.name}"
    stream.log(f"{place}/image", rr.EncodedImage(contents=view.jpeg, media_type="image/jpeg"))
    if view.depth_units is not None:
        units = np.ascontiguousarray(view.depth_units, np.uint16)
        stream.log(f"{place}/depth", rr.DepthImage(units, meter=1.0 / view.metres_per_unit))


def _log_sightings(stream: rr.RecordingStream, camera: Camera, matches: list[JudgedMatch]) -> None:
    place, size = f"{DRONE}/{camera.name}/sightings", np.array([camera.width, camera.height])
    if not matches:
        stream.log(place, rr.Clear(recursive=False))
        return
    boxes = [match.box for match in matches]
    mins = [np.array([box.x_min, box.y_min]) * size for box in boxes]
    sizes = [np.array([box.x_max - box.x_min, box.y_max - box.y_min]) * size for box in boxes]
    labels = [f"{match.confidence:.2f}" + (f" {match.rejected}" if match.rejected else "") for match in matches]
    stream.log(place, rr.Boxes2D(mins=mins, sizes=sizes, labels=labels))


def _log_mounting(stream: rr.RecordingStream, camera: Camera) -> None:
    place, there = f"{DRONE}/{camera.name}", mounting(camera)
    stream.log(
        place,
        rr.Transform3D(translation=there.position, quaternion=rr.Quaternion(xyzw=there.rotation)),
        rr.Pinhole(
            focal_length=[camera.fx_px, camera.fy_px],
            principal_point=[camera.cx_px, camera.cy_px],
            resolution=[camera.width, camera.height],
            camera_xyz=rr.ViewCoordinates.RDF,
        ),
        static=True,
    )


def _log_buildings(stream: rr.RecordingStream, scene: Scene) -> None:
    strips = []
    for building in scene.buildings:
        outline = [*floor_outline(building, 1)]
        outline.append(outline[0])
        top = wall_height_m(building)
        strips += [[[x, y, z] for x, y in outline] for z in (0.0, top)]
        strips += [[[x, y, 0.0], [x, y, top]] for x, y in outline[:-1]]
    stream.log("world/buildings", rr.LineStrips3D(strips, radii=0.03), static=True)


def _corners(steps: tuple[Step, ...]) -> list[list[float]]:
    """Of the whole way flown."""
    way = [[steps[0].pose.x, steps[0].pose.y, steps[0].pose.z]]
    for step in steps:
        way += [[corner.x, corner.y, corner.z] for corner in step.path]
        way.append([step.end.x, step.end.y, step.end.z])
    return way
