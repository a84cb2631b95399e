"""Exports opened by the formats' own tools: `lerobot-doctor`, Hugging Face's `datasets` and `rerun rrd verify`.

Run by `make test-export`, which prepares the tools.
"""

import asyncio
import json
import os
import subprocess
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from contracts.images import depth_in_metres
from evaluation.bench.folder import read_records, read_tasks
from evaluation.export.episodes import Episode, read_episode
from evaluation.export.formats import export
from tests.evaluation.recorded_run import recorded_run

pytestmark = pytest.mark.exports
ROOT = Path(__file__).parents[2]
TOOLS = ROOT / ".cache" / "exports" / "bin"
RERUN = ROOT / ".venv" / "bin" / "rerun"
READ = Path(__file__).parent / "read_lerobot.py"


def said(*command: str | Path) -> str:
    environment = os.environ | {"RERUN_ANALYTICS_ENABLED": "false", "HF_HUB_OFFLINE": "1"}
    done = subprocess.run([*map(str, command)], capture_output=True, text=True, env=environment, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return asyncio.run(recorded_run(tmp_path_factory.mktemp("exports") / "run"))


@pytest.fixture(scope="module")
def lerobot(run: Path) -> Path:
    assert export(run, run.with_name("lerobot"), "lerobot").episodes == 2
    return run.with_name("lerobot")


def episodes(run: Path) -> list[Episode]:
    return [read_episode(run, read_tasks(run).task(record.task), record) for record in read_records(run)]


def test_lerobot_doctor_finds_nothing_wrong(lerobot: Path) -> None:
    found = json.loads(said(TOOLS / "lerobot-doctor", lerobot, "--json"))
    assert [check["name"] for check in found["checks"] if check["severity"] == "FAIL"] == [], found
    assert len(found["checks"]) >= 10


def test_datasets_reads_states_actions_and_depth_as_they_were(run: Path, lerobot: Path, tmp_path: Path) -> None:
    said(TOOLS / "python", READ, lerobot, tmp_path / "read.npz")
    read: dict[str, Any] = dict(np.load(tmp_path / "read.npz", allow_pickle=False))
    steps = [step for episode in episodes(run) for step in episode.steps]
    assert read["observation.state"] == pytest.approx(np.array([list(s.pose.model_dump().values()) for s in steps]))
    assert read["action"][:, :4] == pytest.approx(np.array([step.motion for step in steps]), abs=1e-5)
    assert list(read["action"][:, 4]) == [float(step.claims) for step in steps]
    for number, step in enumerate(steps):
        for view in step.views():
            depth = read[f"observation.images.{view.camera.name}_depth"][number]
            assert view.depth_units is not None
            assert np.array_equal(np.rint(depth / view.metres_per_unit).astype(np.uint16), view.depth_units)
            measured = np.isfinite(metres := depth_in_metres(view.depth_units, view.metres_per_unit))
            assert np.array_equal(depth[measured], metres[measured])
    assert list(read["tasks"]) == [episodes(run)[0].task.request]


def test_the_films_show_each_step_of_each_episode_at_its_time(run: Path, lerobot: Path) -> None:
    import av  # not there in the default suite, which collects this module as well

    steps = [step for episode in episodes(run) for step in episode.steps]
    for camera in episodes(run)[0].cameras:
        film = lerobot / "videos" / f"observation.images.{camera.name}" / "chunk-000" / "file-000.mp4"
        with av.open(str(film)) as container:
            frames = list(container.decode(video=0))
        assert [frame.time for frame in frames] == [float(n) for n in range(len(steps))]
        for frame, step in zip(frames, steps, strict=True):
            jpeg = next(view.jpeg for view in step.views() if view.camera == camera)
            shown = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
            assert shown is not None
            error = np.abs(frame.to_ndarray(format="bgr24").astype(int) - shown.astype(int)).mean()
            assert error < 6.0, f"frame {frame.time} of {camera.name} differs by {error:.1f} on average"


def test_rerun_verifies_its_file_and_finds_every_step_in_it(run: Path) -> None:
    out = run.with_name("rerun")
    assert export(run, out, "rerun").episodes == 2
    files = sorted(out.glob("*.rrd"))
    assert [file.name for file in files] == ["t-1.rrd", "t-2.rrd"]
    assert "2 files verified without error" in said(RERUN, "rrd", "verify", *files)
    printed = said(RERUN, "rrd", "print", files[0])
    steps = len(episodes(run)[0].steps)
    for camera in episodes(run)[0].cameras:
        for what in ("image - ", "depth - "):
            rows = [line for line in printed.splitlines() if f"/world/drone/{camera.name}/{what}" in line]
            assert sum(int(row.split(" with ")[1].split(" rows")[0]) for row in rows) == steps, rows
