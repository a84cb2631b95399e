"""A run's flights as steps, and what is told of those that can't be exported."""

import math
import shutil
from pathlib import Path

import pytest

from evaluation.bench.episode_keeping import TRAJECTORY
from evaluation.bench.folder import BadFolder, read_records, read_tasks
from evaluation.export.camera_frames import Quaternion, mounting
from evaluation.export.coco import with_pictures
from evaluation.export.episodes import CannotExport, Episode, read_episode, with_trajectory
from mission.trajectory import ENTRIES, BadTrajectory, DepthFile, SeenEntry, read_depth_units, read_trajectory
from tests.cameras import square
from tests.evaluation.evaluation_kit import a_record, a_result, a_run, a_task


def episode_of(run: Path, name: str = "t-1") -> Episode:
    record = next(record for record in read_records(run) if record.task == name)
    return read_episode(run, read_tasks(run).task(name), record)


def test_a_step_is_a_stop_and_its_motion_leads_to_the_next_stop(run: Path) -> None:
    episode = episode_of(run)
    result = episode.record.result
    assert result is not None
    assert result.verdict is not None
    assert len(episode.steps) >= 4
    for step, following in zip(episode.steps, episode.steps[1:], strict=False):
        yaw, motion = step.pose.yaw, step.motion
        x = step.pose.x + motion.forward_m * math.cos(yaw) - motion.left_m * math.sin(yaw)
        y = step.pose.y + motion.forward_m * math.sin(yaw) + motion.left_m * math.cos(yaw)
        assert (x, y, step.pose.z + motion.up_m) == pytest.approx(
            (following.pose.x, following.pose.y, following.pose.z)
        )
        assert math.remainder(yaw + motion.turn_rad - following.pose.yaw, math.tau) == pytest.approx(0.0, abs=1e-9)
        assert following.time_s > step.time_s
    assert [step.claims for step in episode.steps] == [False] * (len(episode.steps) - 1) + [True]
    assert any(match.accepted for step in episode.steps for match in step.sightings)
    assert all(step.said for step in episode.steps)


def test_steps_have_the_depth_as_it_came(run: Path) -> None:
    episode = episode_of(run)
    folder = run / "episodes" / "t-1" / TRAJECTORY
    last = [entry for entry in read_trajectory(folder) if isinstance(entry, SeenEntry)][-1]
    for view, kept in zip(episode.steps[-1].views(), last.views, strict=True):
        assert isinstance(kept.depth, DepthFile)
        assert view.depth_units is not None
        assert (view.depth_units == read_depth_units(folder, kept.depth)).all()


def test_a_flight_that_lost_something_is_named_with_what_it_lost(own_run: Path) -> None:
    run = own_run
    folder = run / "episodes" / "t-1" / TRAJECTORY
    entries = folder / ENTRIES
    whole = entries.read_bytes()
    lines = whole.splitlines(keepends=True)
    entries.write_bytes(b"".join(lines[:-1]))
    with pytest.raises(BadTrajectory, match="has lost its end: a window was claimed"):
        episode_of(run)
    entries.write_bytes(b"".join(line for line in lines if b'"kind":"flown"' not in line))
    with pytest.raises(BadTrajectory, match=r"tells of 0\.0 m of .* m flown: it has lost something"):
        episode_of(run)
    entries.write_bytes(whole)
    picture = sorted(folder.glob("*.jpg"))[-1]
    jpeg = picture.read_bytes()
    picture.write_bytes(jpeg[: len(jpeg) // 2])
    with pytest.raises(BadTrajectory, match=f"{picture.name} is cut short"):
        episode_of(run)
    picture.write_bytes(b"GIF89a" + bytes(20))
    with pytest.raises(BadTrajectory, match=f"{picture.name} has "):
        episode_of(run)
    picture.unlink()
    with pytest.raises(BadTrajectory, match=f"{picture.name}: No such file"):
        episode_of(run)


def test_a_run_without_what_is_needed_says_how_it_is_flown(own_run: Path, tmp_path: Path) -> None:
    run = own_run
    for name in ("t-1", "t-2"):
        shutil.rmtree(run / "episodes" / name / TRAJECTORY)
    with pytest.raises(CannotExport, match=r"flown without --trajectories.*logisticsvln bench --trajectories --out"):
        with_trajectory(run)
    assert [task.id for task in with_pictures(run).tasks] == ["t-1", "t-2"]
    bare = a_run(tmp_path / "bare", [a_task("t-1")], [])
    with pytest.raises(CannotExport, match="not flown yet"):
        with_trajectory(bare)
    with pytest.raises(CannotExport, match=r"not flown yet.*--pictures all"):
        with_pictures(bare)
    with pytest.raises(BadFolder, match="holds no run"):
        with_trajectory(tmp_path / "nowhere")


def test_flights_that_are_left_out_are_told_with_the_reason(own_run: Path) -> None:
    run = own_run
    tasks = read_tasks(run).tasks
    failed = a_record(tasks[1], a_result("object_not_found"))
    lines = (run / "results.jsonl").read_text().splitlines()
    (run / "results.jsonl").write_text(f"{lines[0]}\n{failed.model_dump_json()}\n")
    assert [task.id for task in with_trajectory(run).tasks] == ["t-1", "t-2"]
    found = with_trajectory(run, only_successes=True)
    assert [task.id for task in found.tasks] == ["t-1"]
    assert found.left_out == {"t-2": f"no success: {failed.reason}"}


def turned(rotation: Quaternion, x: float, y: float, z: float) -> tuple[float, float, float]:
    """The vector (x, y, z) of the turned frame, in the frame it is turned in."""
    a, b, c, w = rotation
    tx, ty, tz = 2 * (b * z - c * y), 2 * (c * x - a * z), 2 * (a * y - b * x)
    return x + w * tx + b * tz - c * ty, y + w * ty + c * tx - a * tz, z + w * tz + a * ty - b * tx


@pytest.mark.parametrize("heading", [-90.0, -45.0, 0.0, 45.0, 180.0])
@pytest.mark.parametrize("pitch", [-40.0, 0.0, 30.0])
def test_a_cameras_frame_looks_where_its_heading_and_pitch_say(heading: float, pitch: float) -> None:
    mounted = mounting(square(heading).model_copy(update={"pitch_deg": pitch}))
    right, up = math.radians(heading), math.radians(pitch)
    ahead = (math.cos(up) * math.cos(right), -math.cos(up) * math.sin(right), math.sin(up))
    assert turned(mounted.rotation, 0.0, 0.0, 1.0) == pytest.approx(ahead, abs=1e-9)
    assert turned(mounted.rotation, 1.0, 0.0, 0.0) == pytest.approx((-math.sin(right), -math.cos(right), 0.0), abs=1e-9)
    assert turned(mounted.rotation, 0.0, 1.0, 0.0)[2] < 0.0, "y points down"
