"""What a vehicle's cameras saw and how it was flown, stop by stop and without loss: for training sets and exports.

trajectory.jsonl       one of `TrajectoryEntry` a line, flushed as it happens
0001_front.jpg         observation 1 by camera `front`: the JPEG as the vehicle sent it
0001_front.depth.zst   its depth as the vehicle sent it: little-endian uint16, row by row, zstd

A picture is there before the line that names it; a last line that was cut off is none.
"""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Annotated, Literal, Self, TypeAlias

import numpy as np
import pybase64
from numpy.typing import NDArray
from pydantic import Field, TypeAdapter, ValidationError

from contracts.base import Metres, Name, Radians, Wire
from contracts.cameras import Camera
from contracts.errors import first_problem
from contracts.geometry import Point3, Pose
from contracts.images import BadImage, DepthMap, decode_depth_units, jpeg_bytes
from contracts.sim import Verdict
from contracts.vehicle import ClockSeconds, Move, MoveResult, Observation, VehicleCapabilities

ENTRIES = "trajectory.jsonl"
VERSION: Literal[1] = 1
FileName = Annotated[str, Field(min_length=1, max_length=200, pattern=r"^[A-Za-z0-9][A-Za-z0-9_.:-]*$")]


class BadTrajectory(ValueError):
    """A recording that can't be used; the message says which file, and what is wrong with it."""


class DepthFile(Wire):
    """A file of depth and how it is read; as in `contracts.images.DepthMap`."""

    file: FileName
    width: int = Field(ge=1, le=4096)
    height: int = Field(ge=1, le=4096)
    metres_per_unit: float = Field(ge=1e-6, le=1.0)


class SeenView(Wire):
    """One camera's picture and depth, as files beside the entries."""

    camera: Camera
    picture: FileName
    depth: DepthFile | None


class BegunEntry(Wire):
    """The first entry: what is flown."""

    kind: Literal["begun"] = "begun"
    version: Literal[1] = VERSION
    vehicle: VehicleCapabilities


class SeenEntry(Wire):
    """An observation with all cameras; `asked`: those whose views the mission got."""

    kind: Literal["seen"] = "seen"
    number: int = Field(ge=1)
    pose: Pose
    time_s: ClockSeconds | None
    asked: tuple[Name, ...]
    views: tuple[SeenView, ...] = Field(min_length=1)


class FlownEntry(Wire):
    """A move as it was ordered (`path`, `yaw`), and where it ended."""

    kind: Literal["flown"] = "flown"
    number: int
    path: tuple[Point3, ...]
    yaw: Radians | None
    pose: Pose
    reached: bool
    collided: bool
    path_m: Metres
    flight_s: float = Field(ge=0.0)


class ClaimedEntry(Wire):
    """The mission claimed a window, where it believes the object to be; `verdict` is null where nobody judges."""

    kind: Literal["claimed"] = "claimed"
    target: Point3 | None
    verdict: Verdict | None


TrajectoryEntry: TypeAlias = BegunEntry | SeenEntry | FlownEntry | ClaimedEntry
_ENTRY: TypeAdapter[TrajectoryEntry] = TypeAdapter(Annotated[TrajectoryEntry, Field(discriminator="kind")])


class TrajectoryWriter:
    """Writes a trajectory into a folder of its own. Every method raises OSError; `seen` BadImage as well."""

    def __init__(self, folder: Path) -> None:
        """Raises FileExistsError where there is one already."""
        folder.mkdir(parents=True)
        self._folder = folder
        self._entries = (folder / ENTRIES).open("x", encoding="utf-8")
        self._begun = False
        self._observations = 0

    def begun(self, vehicle: VehicleCapabilities) -> None:
        """Only the first time counts: a vehicle may be connected to again."""
        if not self._begun:
            self._write(BegunEntry(vehicle=vehicle))
            self._begun = True

    def seen(self, observation: Observation, asked: Sequence[str]) -> None:
        self._observations += 1
        views = tuple(self._view(view.camera, jpeg_bytes(view.image), view.depth) for view in observation.views)
        self._write(
            SeenEntry(
                number=self._observations,
                pose=observation.pose,
                time_s=observation.time_s,
                asked=tuple(asked),
                views=views,
            )
        )

    def flown(self, move: Move, done: MoveResult) -> None:
        self._write(
            FlownEntry(
                number=done.number,
                path=move.path,
                yaw=move.yaw,
                pose=done.pose,
                reached=done.reached,
                collided=done.collided,
                path_m=done.path_m,
                flight_s=done.flight_s,
            )
        )

    def claimed(self, target: Point3 | None, verdict: Verdict | None) -> None:
        self._write(ClaimedEntry(target=target, verdict=verdict))

    def _view(self, camera: Camera, jpeg: bytes, depth: DepthMap | None) -> SeenView:
        stem = f"{self._observations:04d}_{camera.name}"
        (self._folder / f"{stem}.jpg").write_bytes(jpeg)
        kept = None
        if depth is not None:
            kept = DepthFile(
                file=f"{stem}.depth.zst",
                width=depth.width,
                height=depth.height,
                metres_per_unit=depth.metres_per_unit,
            )
            (self._folder / kept.file).write_bytes(pybase64.b64decode(depth.zstd_base64))
        return SeenView(camera=camera, picture=f"{stem}.jpg", depth=kept)

    def _write(self, entry: TrajectoryEntry) -> None:
        self._entries.write(entry.model_dump_json() + "\n")
        self._entries.flush()

    def close(self) -> None:
        self._entries.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def read_trajectory(folder: Path) -> list[TrajectoryEntry]:
    """The entries up to a last one that was cut off. Raises BadTrajectory where there are none, or one is damaged."""
    path = folder / ENTRIES
    try:
        data = path.read_bytes()
    except OSError as error:
        raise BadTrajectory(f"{path}: {os.strerror(error.errno or 0)}") from None
    entries: list[TrajectoryEntry] = []
    for number, line in enumerate(data.split(b"\n")[:-1], start=1):
        try:
            entries.append(_ENTRY.validate_json(line, extra="ignore"))
        except ValidationError as error:
            raise BadTrajectory(f"{path}, line {number}: {first_problem(error)}") from None
    if not entries or not isinstance(entries[0], BegunEntry):
        raise BadTrajectory(f"{path} is empty or does not begin with what was flown: the flight was cut off")
    return entries


def read_picture(folder: Path, view: SeenView) -> bytes:
    """The JPEG. Raises BadTrajectory where it is missing."""
    return _bytes(folder / view.picture)


def read_depth_units(folder: Path, depth: DepthFile) -> NDArray[np.uint16]:
    """(H, W) in units of `metres_per_unit`; 0 is unknown, 65535 nothing within the sensor's reach. Raises BadTrajectory
    where the file is missing or damaged."""
    packed = pybase64.b64encode(_bytes(folder / depth.file)).decode("ascii")
    fields: Mapping[str, object] = depth.model_dump(exclude={"file"})
    try:
        return decode_depth_units(DepthMap.model_validate({**fields, "zstd_base64": packed}))
    except (BadImage, ValidationError) as error:
        said = first_problem(error) if isinstance(error, ValidationError) else str(error)
        raise BadTrajectory(f"{folder / depth.file}: {said}") from None


def _bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise BadTrajectory(f"{path}: {os.strerror(error.errno or 0)}") from None
