"""COCO and MCAP as their readers find them, and the export's folder: whole, or not there."""

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from typer.testing import CliRunner

from command_line.main import app
from contracts.events import LookEvent
from contracts.images import depth_in_metres, image_header
from evaluation.bench.folder import read_records, read_tasks
from evaluation.export import formats
from evaluation.export.episodes import CannotExport, read_episode
from evaluation.export.formats import export
from mission.record import read_events
from tests.evaluation.recorded_run import REQUEST


def test_coco_has_every_picture_that_was_shown_and_the_boxes_named_in_it(run: Path, tmp_path: Path) -> None:
    assert export(run, tmp_path / "coco", "coco").episodes == 2
    document = json.loads((tmp_path / "coco" / "annotations.json").read_text())
    looks = [e for name in ("t-1", "t-2") for e in read_events(run / "episodes" / name) if isinstance(e, LookEvent)]
    assert len(document["images"]) == sum(len(look.data.views) for look in looks)
    assert len(document["annotations"]) == sum(len(look.data.answer.matches) for look in looks) > 0
    assert [category["name"] for category in document["categories"]] == ["flower_pot"]
    images = {image["id"]: image for image in document["images"]}
    for image in images.values():
        header = image_header((tmp_path / "coco" / image["file_name"]).read_bytes())
        assert (header.width, header.height) == (image["width"], image["height"])
    for annotation in document["annotations"]:
        x, y, width, height = annotation["bbox"]
        image = images[annotation["image_id"]]
        assert min(x, y, width, height) >= 0
        assert x + width <= image["width"] + 0.02
        assert y + height <= image["height"] + 0.02
        assert annotation["area"] == pytest.approx(width * height, rel=1e-2)


def messages(file: Path) -> dict[str, list[Any]]:
    """By topic, in the order of their time: Foxglove's messages decoded, JSON as it is."""
    found: dict[str, list[Any]] = {}
    with file.open("rb") as opened:
        for _, channel, message, decoded in make_reader(
            opened, decoder_factories=[DecoderFactory(), JsonDecoder()]
        ).iter_decoded_messages():
            assert message.log_time == message.publish_time
            found.setdefault(channel.topic, []).append(decoded)
    return found


class JsonDecoder:
    def decoder_for(self, encoding: str, schema: object):
        return json.loads if encoding == "json" else None


def test_the_mcap_reader_finds_pictures_depth_poses_and_actions_of_every_step(run: Path, tmp_path: Path) -> None:
    export(run, tmp_path / "mcap", "mcap")
    assert sorted(path.name for path in (tmp_path / "mcap").iterdir()) == ["t-1.mcap", "t-2.mcap"]
    episode = read_episode(run, read_tasks(run).task("t-1"), read_records(run)[0])
    found = messages(tmp_path / "mcap" / "t-1.mcap")
    assert found["/log"][0].message == REQUEST
    assert len(found["/drone/pose"]) == len(found["/action"]) == len(episode.steps)
    for number, step in enumerate(episode.steps):
        there = found["/drone/pose"][number].pose.position
        assert (there.x, there.y, there.z) == (step.pose.x, step.pose.y, step.pose.z)
        assert found["/action"][number]["forward_m"] == pytest.approx(step.motion.forward_m)
        for view in step.views():
            topic = f"/camera/{view.camera.name}"
            assert found[f"{topic}/image"][number].data == view.jpeg
            depth = found[f"{topic}/depth"][number]
            metres = np.frombuffer(depth.data, "<f4").reshape(depth.height, depth.width)
            assert view.depth_units is not None
            wanted = np.nan_to_num(depth_in_metres(view.depth_units, view.metres_per_unit), nan=0.0, posinf=np.inf)
            assert np.array_equal(metres, wanted)
            assert found[f"{topic}/calibration"][number].K[0] == view.camera.fx_px
    boxes = [
        drawn for topic, all_of in found.items() if topic.endswith("/sightings") for drawn in all_of if drawn.points
    ]
    assert boxes
    assert found["/action"][-1]["claim"] is True


def test_damaged_flights_are_left_out_whole_and_named(own_run: Path, tmp_path: Path) -> None:
    picture = max((own_run / "episodes" / "t-1" / "trajectory").glob("*.jpg"))
    picture.unlink()
    done = export(own_run, tmp_path / "mcap", "mcap")
    assert done.episodes == 1
    assert picture.name in done.damaged["t-1"]
    assert [path.name for path in (tmp_path / "mcap").iterdir()] == ["t-2.mcap"]
    for name in ("t-1", "t-2"):
        min((own_run / "episodes" / name / "pictures").glob("*_view*.jpg")).unlink()
        (own_run / "episodes" / name / "trajectory" / "trajectory.jsonl").unlink()
    with pytest.raises(CannotExport, match=r"no flight of .* is whole"):
        export(own_run, tmp_path / "none", "mcap")
    assert not list(tmp_path.glob("none*"))


def test_an_export_that_breaks_off_leaves_nothing_and_a_second_takes_its_place(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class FullDisk:
        def __init__(self, folder: Path, run: Path) -> None:
            (folder / "half").write_text("half of it")

        def add(self, *_: object) -> None:
            raise OSError(28, "No space left on device", "somewhere.mcap")

        def finish(self) -> None: ...
        def close(self) -> None: ...

    out = tmp_path / "mcap"
    monkeypatch.setattr(formats, "_writer", lambda name: FullDisk)
    told = CliRunner().invoke(app, ["export", str(run), "--format", "mcap", "--out", str(out)])
    assert told.exit_code == 1
    assert "somewhere.mcap: No space left on device; nothing of" in told.output
    assert not list(tmp_path.iterdir())
    monkeypatch.undo()
    (tmp_path / "mcap.part").mkdir()
    (tmp_path / "mcap.part" / "left-by-a-killed-process").write_text("")
    assert export(run, out, "mcap").episodes == 2
    assert {path.name for path in out.iterdir()} == {"t-1.mcap", "t-2.mcap"}
    told = CliRunner().invoke(app, ["export", str(run), "--format", "mcap", "--out", str(out)])
    assert told.exit_code == 2
    assert "is there already; name another --out" in told.output


def test_the_command_tells_what_it_wrote_and_what_it_left_out(own_run: Path, tmp_path: Path) -> None:
    shutil.rmtree(own_run / "episodes" / "t-2")
    told = CliRunner().invoke(app, ["export", str(own_run), "--format", "coco"])
    assert told.exit_code == 0, told.output
    assert f"{own_run}-coco: 1 flight; 1 left out: flown without --pictures all" in told.output.replace("\n", "")
    nothing = CliRunner().invoke(app, ["export", str(tmp_path / "nowhere"), "--format", "mcap"])
    assert nothing.exit_code == 2
    assert "holds no run" in nothing.output
