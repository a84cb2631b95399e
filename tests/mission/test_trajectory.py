"""A trajectory: all that was seen and flown, without loss; and what a damaged or unfinished one says."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from contracts.images import decode_depth_units, jpeg_bytes
from contracts.orchestrator import DeliveryResult, MissionSettings
from mission.mission import Mission
from mission.placement import InTrial, Placement, trial_question
from mission.record import Log
from mission.trajectory import (
    ENTRIES,
    BadTrajectory,
    BegunEntry,
    ClaimedEntry,
    FlownEntry,
    SeenEntry,
    TrajectoryWriter,
    read_depth_units,
    read_picture,
    read_trajectory,
)
from mission.vehicles.recorded import RecordedPlacement
from tests.mission.block import Block, block_scene
from tests.mission.block_vehicle import BlockWorld
from tests.mission.box_world import block_ports

REQUEST = "floor 4, the green flower pot"


class Nothing:
    def write(self, *_: object) -> None: ...


def a_world() -> BlockWorld:
    return BlockWorld(Block(thing=(2.0, 6.2, 10.5), thing_normal=(0.0, 1.0)))


async def flown(
    world: BlockWorld, trajectory: TrajectoryWriter | None = None, log: Log | None = None
) -> DeliveryResult:
    settings = MissionSettings()
    placement: Placement = InTrial(world, trial_question(block_scene(world.block), settings))
    if trajectory is not None:
        placement = RecordedPlacement(placement, trajectory)
    return await Mission(block_ports(world), placement, settings, log or Nothing()).fly(REQUEST, "key")


def apart_from_time(result: DeliveryResult) -> dict[str, object]:
    told = result.model_dump(exclude={"timings_s"})
    for calls in told["model_calls"].values():
        del calls["seconds"], calls["latencies_s"]
    return told


async def test_a_mission_that_is_recorded_flies_as_one_that_is_not(tmp_path: Path) -> None:
    with TrajectoryWriter(tmp_path / "t") as trajectory:
        recorded = await flown(a_world(), trajectory)
    assert recorded.outcome == "delivered"
    assert apart_from_time(recorded) == apart_from_time(await flown(a_world()))


async def test_a_trajectory_has_every_look_with_all_cameras_every_move_and_the_claim(tmp_path: Path) -> None:
    world = a_world()
    with TrajectoryWriter(tmp_path / "t") as trajectory:
        result = await flown(world, trajectory)
    begun, *entries = read_trajectory(tmp_path / "t")
    assert isinstance(begun, BegunEntry)
    names = [camera.name for camera in begun.vehicle.cameras]
    looks = [entry for entry in entries if isinstance(entry, SeenEntry)]
    moves = [entry for entry in entries if isinstance(entry, FlownEntry)]
    assert all([view.camera.name for view in look.views] == names for look in looks)
    assert any(len(look.asked) < len(names) for look in looks), "floors are counted with the front camera alone"
    assert sum(move.path_m for move in moves) == pytest.approx(result.path_m)
    assert [move.number for move in moves] == list(range(1, len(moves) + 1))
    assert isinstance(entries[-1], ClaimedEntry)
    assert entries[-1].verdict == result.verdict


async def test_pictures_and_depth_are_kept_to_the_bit(tmp_path: Path) -> None:
    world = a_world()
    with TrajectoryWriter(tmp_path / "t") as trajectory:
        await flown(world, trajectory)
    vehicle = world.vehicles[world.boarded]
    vehicle.released = False
    last = [entry for entry in read_trajectory(tmp_path / "t") if isinstance(entry, SeenEntry)][-1]
    vehicle._set(pose=last.pose)  # where it was put right after its last look does not count here
    now = await vehicle.observe()
    for view, kept in zip(now.views, last.views, strict=True):
        assert read_picture(tmp_path / "t", kept) == jpeg_bytes(view.image)
        assert view.depth is not None
        assert kept.depth is not None
        assert np.array_equal(read_depth_units(tmp_path / "t", kept.depth), decode_depth_units(view.depth))


async def test_a_trajectory_that_was_cut_off_ends_before_its_last_half_line(tmp_path: Path) -> None:
    with TrajectoryWriter(tmp_path / "t") as trajectory:
        await flown(a_world(), trajectory)
    whole = read_trajectory(tmp_path / "t")
    path = tmp_path / "t" / ENTRIES
    data = path.read_bytes()
    path.write_bytes(data[:-20])
    assert read_trajectory(tmp_path / "t") == whole[:-1]
    path.write_bytes(data.replace(b'"kind":"flown"', b'"kind":"floun"', 1))
    with pytest.raises(BadTrajectory, match=rf"{ENTRIES}, line \d+: "):
        read_trajectory(tmp_path / "t")
    path.write_bytes(b"")
    with pytest.raises(BadTrajectory, match="the flight was cut off"):
        read_trajectory(tmp_path / "t")
    with pytest.raises(BadTrajectory, match="No such file"):
        read_trajectory(tmp_path / "nowhere")


async def test_a_missing_picture_and_damaged_depth_are_named(tmp_path: Path) -> None:
    with TrajectoryWriter(tmp_path / "t") as trajectory:
        await flown(a_world(), trajectory)
    look = next(entry for entry in read_trajectory(tmp_path / "t") if isinstance(entry, SeenEntry))
    view = look.views[0]
    assert view.depth is not None
    (tmp_path / "t" / view.picture).unlink()
    with pytest.raises(BadTrajectory, match=f"{view.picture}: No such file"):
        read_picture(tmp_path / "t", view)
    (tmp_path / "t" / view.depth.file).write_bytes(b"not depth at all")
    with pytest.raises(BadTrajectory, match=f"{view.depth.file}: the depth data is not a zstd frame"):
        read_depth_units(tmp_path / "t", view.depth)


async def test_a_disk_that_takes_no_more_is_no_failure_of_the_mission(tmp_path: Path) -> None:
    with TrajectoryWriter(tmp_path / "t") as trajectory:
        shutil.rmtree(tmp_path / "t")
        result = await flown(a_world(), trajectory)
    assert result.outcome == "service_unreachable"
    assert "what was seen can't be kept: No such file" in result.message
