"""The flights of a run as steps: a stop with all that was seen there, and what was done next.

Looks from one place are one step, as the world counts them. Every file of an episode is read once before anything is
made of it, so that an episode is exported whole or not at all.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from contracts.cameras import Camera
from contracts.event_data import JudgedMatch
from contracts.events import LookEvent, MissionEvent
from contracts.geometry import Point3, Pose
from contracts.images import BadImage, image_header
from evaluation.bench.episode_keeping import TRAJECTORY
from evaluation.bench.folder import read_records, read_tasks
from evaluation.metrics.episode import EpisodeRecord
from evaluation.task_set.task import Task
from mission.record import read_events
from mission.trajectory import (
    BadTrajectory,
    BegunEntry,
    ClaimedEntry,
    FlownEntry,
    SeenEntry,
    SeenView,
    TrajectoryEntry,
    read_depth_units,
    read_picture,
    read_trajectory,
)

_JPEG_END = b"\xff\xd9"


class CannotExport(ValueError):
    """There is nothing to export, or it can't be exported so; the message says what would help."""


class Motion(NamedTuple):
    """From one stop to the next in the drone's own frame at the first: metres ahead, to the left and up, radians turned
    counter-clockwise."""

    forward_m: float
    left_m: float
    up_m: float
    turn_rad: float


class View(NamedTuple):
    """One camera's view. `depth_units`: (H, W) uint16 of `metres_per_unit`, 0 unknown, 65535 nothing within reach; null
    where the camera has no depth."""

    camera: Camera
    jpeg: bytes
    depth_units: NDArray[np.uint16] | None
    metres_per_unit: float


@dataclass(frozen=True)
class Step:
    """One stop: seconds of flight before it, what was seen there, the corners flown over next (empty: none were), the
    pose that this led to, and whether a window was claimed from here. `sightings`: what the mission made of the
    recognition model's answer; `said`: what it wrote down about the stop."""

    time_s: float
    pose: Pose
    path: tuple[Point3, ...]
    end: Pose
    claims: bool
    sightings: tuple[JudgedMatch, ...]
    said: tuple[str, ...]
    folder: Path
    seen: tuple[SeenView, ...]

    @property
    def motion(self) -> Motion:
        """What was done here: the way to `end`."""
        east, north = self.end.x - self.pose.x, self.end.y - self.pose.y
        cos, sin = math.cos(self.pose.yaw), math.sin(self.pose.yaw)
        turned = math.remainder(self.end.yaw - self.pose.yaw, math.tau)
        return Motion(east * cos + north * sin, north * cos - east * sin, self.end.z - self.pose.z, turned)

    def views(self) -> Iterator[View]:
        """In the order of the rig. Raises BadTrajectory."""
        for view in self.seen:
            depth = view.depth
            units = None if depth is None else read_depth_units(self.folder, depth)
            metres_per_unit = 0.0 if depth is None else depth.metres_per_unit
            yield View(view.camera, read_picture(self.folder, view), units, metres_per_unit)


@dataclass(frozen=True)
class Episode:
    """One flight. `cameras`: the vehicle's, in the order of every step's views."""

    task: Task
    record: EpisodeRecord
    cameras: tuple[Camera, ...]
    steps: tuple[Step, ...]


class Found(NamedTuple):
    """What of a run can be exported: the flights by task, of the others why not; `records` of all by task."""

    tasks: tuple[Task, ...]
    left_out: dict[str, str]
    records: dict[str, EpisodeRecord]


class _Stop(NamedTuple):
    """The last look from a place, seconds of flight before it, and the moves away from it."""

    seen: SeenEntry
    time_s: float
    moves: list[FlownEntry]


def find_flights(
    run: Path, lacks: Callable[[Task, EpisodeRecord], str | None], only_successes: bool, what: str, remedy: str
) -> Found:
    """`lacks` says what a flight has not got. Raises BadFolder, CannotExport where there is none of `what`."""
    records = {record.task: record for record in read_records(run)}
    found: list[Task] = []
    left_out: dict[str, str] = {}
    for task in read_tasks(run).tasks:
        record = records.get(task.id)
        if record is None:
            left_out[task.id] = "not flown yet"
        elif (lacking := lacks(task, record)) is not None:
            left_out[task.id] = lacking
        elif only_successes and not record.success:
            left_out[task.id] = f"no success: {record.reason}"
        else:
            found.append(task)
    if not found:
        why = next(iter(left_out.values()), "it has no tasks")
        raise CannotExport(f"{run} has no {what} to export ({why}); {remedy}")
    return Found(tuple(found), left_out, records)


def with_trajectory(run: Path, *, only_successes: bool = False) -> Found:
    """The tasks of a run whose flights were kept. Raises BadFolder, CannotExport where there is none."""

    def lacks(task: Task, record: EpisodeRecord) -> str | None:
        if not record.judged:
            return "a model or a service was out of reach"
        return None if trajectory_folder(run, task).is_dir() else "flown without --trajectories"

    remedy = f"`logisticsvln bench --trajectories --out {run}` keeps what is needed of the flights that it makes"
    return find_flights(run, lacks, only_successes, "flight", remedy)


def trajectory_folder(run: Path, task: Task) -> Path:
    return run / "episodes" / task.id / TRAJECTORY


def read_episode(run: Path, task: Task, record: EpisodeRecord) -> Episode:
    """Every file of it is there and whole, or BadTrajectory says which is not."""
    folder = trajectory_folder(run, task)
    begun, *entries = read_trajectory(folder)
    assert isinstance(begun, BegunEntry)
    _check_ended(folder, entries, record)
    events = [event for event in read_events(folder.parent) if isinstance(event, MissionEvent)]
    steps = _steps(folder, entries, events)
    for step in steps:
        _check_files(step)
    return Episode(task, record, begun.vehicle.cameras, steps)


def _check_ended(folder: Path, entries: Sequence[TrajectoryEntry], record: EpisodeRecord) -> None:
    """A flight whose result was written has all its moves, or something was lost."""
    if not any(isinstance(entry, SeenEntry) for entry in entries):
        raise BadTrajectory(f"{folder}: nothing was seen on this flight")
    result = record.result
    flown_m = sum(entry.path_m for entry in entries if isinstance(entry, FlownEntry))
    if result is not None and result.verdict is not None and not isinstance(entries[-1], ClaimedEntry):
        raise BadTrajectory(f"{folder} has lost its end: a window was claimed, and it does not say so")
    if result is not None and flown_m < result.path_m - 0.01 * max(1.0, result.path_m):
        raise BadTrajectory(f"{folder} tells of {flown_m:.1f} m of {result.path_m:.1f} m flown: it has lost something")


def _steps(folder: Path, entries: Sequence[TrajectoryEntry], events: Sequence[MissionEvent]) -> tuple[Step, ...]:
    """A step for each place where something was seen; the last look there counts."""
    stops: list[_Stop] = []
    flown_s, claimed = 0.0, False
    for entry in entries:
        if isinstance(entry, SeenEntry):
            if stops and not stops[-1].moves:
                stops[-1] = stops[-1]._replace(seen=entry)
            else:
                stops.append(_Stop(entry, flown_s, []))
        elif isinstance(entry, FlownEntry):
            flown_s += entry.flight_s
            if stops:
                stops[-1].moves.append(entry)
        elif isinstance(entry, ClaimedEntry):
            claimed = True
    told = _told(stops, events)
    return tuple(
        Step(
            time_s=stop.time_s,
            pose=stop.seen.pose,
            path=tuple(corner for move in stop.moves for corner in move.path),
            end=stop.moves[-1].pose if stop.moves else stop.seen.pose,
            claims=claimed and number == len(stops) - 1,
            sightings=tuple(match for event in heard if isinstance(event, LookEvent) for match in event.data.sightings),
            said=tuple(event.message for event in heard),
            folder=folder,
            seen=stop.seen.views,
        )
        for number, (stop, heard) in enumerate(zip(stops, told, strict=True))
    )


def _told(stops: Sequence[_Stop], events: Sequence[MissionEvent]) -> list[list[MissionEvent]]:
    """The events that tell of each stop: those whose data say that they are from its pose."""
    told: list[list[MissionEvent]] = [[] for _ in stops]
    at = 0
    for event in events:
        pose = getattr(event.data, "pose", None)
        there = next((n for n in range(at, len(stops)) if stops[n].seen.pose == pose), None)
        if there is not None:
            at = there
            told[at].append(event)
    return told


def _check_files(step: Step) -> None:
    for view in step.views():
        name = next(seen.picture for seen in step.seen if seen.camera == view.camera)
        try:
            header = image_header(view.jpeg)
        except BadImage as error:
            raise BadTrajectory(f"{step.folder / name}: {error}") from None
        if (header.width, header.height) != (view.camera.width, view.camera.height):
            raise BadTrajectory(
                f"{step.folder / name} has {header.width} x {header.height} pixels, its camera "
                f"{view.camera.width} x {view.camera.height}"
            )
        if not view.jpeg.rstrip(b"\0").endswith(_JPEG_END):
            raise BadTrajectory(f"{step.folder / name} is cut short")
