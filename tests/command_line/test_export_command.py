"""`logisticsvln export`: where an export goes that is given no place."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from command_line.export import place_beside
from command_line.main import app

RUN = CliRunner()


@pytest.mark.parametrize("run", [".", "..", "/", "nowhere"])
def test_a_folder_that_holds_no_run_is_told_whatever_it_is_called(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, run: str
) -> None:
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    told = RUN.invoke(app, ["export", run, "--format", "coco"])
    assert told.exit_code == 2, told.output
    assert "holds no run" in told.output
    assert list(tmp_path.iterdir()) == [tmp_path / "here"]


@pytest.mark.parametrize("run", [".", "../run", "./", "inner/.."])
def test_an_export_lies_beside_its_run_however_that_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, run: str
) -> None:
    (tmp_path / "run" / "inner").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "run")
    assert place_beside(Path(run), "coco").resolve() == tmp_path / "run-coco"


def test_a_format_that_there_is_not_is_told_in_our_words(tmp_path: Path) -> None:
    told = RUN.invoke(app, ["export", str(tmp_path), "--format", "avi"]).output
    assert "'avi' is not one of 'lerobot'" in told
    assert "Value error" not in told
