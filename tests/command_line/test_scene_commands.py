"""`logisticsvln scene`, run as a command."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from command_line.main import app
from contracts.scene import Scene
from logisticsvln import read_scene, sample
from tests.evaluation.own_scenes.test_osm import street

RUN = CliRunner()


def test_a_scene_made_from_a_few_questions_is_sound_and_is_drawn(tmp_path: Path) -> None:
    out = tmp_path / "corner.json"
    made = RUN.invoke(app, ["scene", "new", str(out), "--kind", "villa", "--floors", "2", "--neighbours", "none"])
    assert made.exit_code == 0, made.output
    scene = read_scene(out)
    assert (scene.name, scene.buildings[0].kind, scene.buildings[0].floors) == ("corner", "villa", 2)
    assert json.loads(out.read_text())["$schema"] == "./scene.schema.json"
    assert (tmp_path / "scene.schema.json").exists()
    assert 'deliver "floor 2, the window with the red flower pot"' in made.output
    shown = RUN.invoke(app, ["scene", "preview", str(out), "--json"])
    assert shown.exit_code == 0, shown.output
    told = json.loads(shown.stdout)
    assert told["problems"] == []
    assert len(told["starts"]) > 20
    assert (tmp_path / "corner.png").stat().st_size > 100_000


def test_a_scene_from_a_map_says_what_it_took(tmp_path: Path) -> None:
    out = tmp_path / "weg.json"
    asked = ["scene", "from-osm", str(street().write(tmp_path)), "--out", str(out), "--target", "100"]
    made = RUN.invoke(app, [*asked, "--object", "kite", "--colour", "blue", "--floor", "3"])
    assert made.exit_code == 0, made.output
    assert "delivers to way/100 (Weg 7)" in made.output
    assert read_scene(out).goal == "goal"
    beige = RUN.invoke(app, [*asked[:3], "--out", str(tmp_path / "b.json"), "--object", "kite", "--colour", "beige"])
    assert beige.exit_code == 2
    assert "a kite comes in" in beige.output
    assert not (tmp_path / "b.json").exists()
    again = RUN.invoke(app, asked)
    assert again.exit_code == 2
    assert "is there already" in again.output


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        (["preview", "nowhere.json"], "nowhere.json: No such file"),
        (["from-osm", "nowhere.osm", "--out", "x.json"], "nowhere.osm: No such file"),
        (["from-osm", "nowhere.osm", "--out", "x.json", "--at", "here"], "is not LAT,LON"),
    ],
)
def test_wrong_input_ends_the_command_with_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], problem: str
) -> None:
    monkeypatch.chdir(tmp_path)
    ended = RUN.invoke(app, ["scene", *arguments])
    assert ended.exit_code == 2
    assert problem in ended.output
    assert "Traceback" not in ended.output
    assert list(tmp_path.iterdir()) == []


def test_every_value_that_is_wrong_is_told_at_once(tmp_path: Path) -> None:
    scene: Scene = sample("green-flower-pot").scene
    broken = scene.model_dump(mode="json") | {"light": {"sky": "green"}, "weather": "rain"}
    path = tmp_path / "broken.json"
    path.write_text(json.dumps(broken))
    ended = RUN.invoke(app, ["scene", "preview", str(path)])
    assert ended.exit_code == 2
    assert "error: light.sky:" in ended.output
    assert "error: weather:" in ended.output
