"""The command over real processes: pictures once, answers, figures, the card."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from command_line.evaluate import CARD, CURVES, SHEET
from command_line.main import app
from evaluation.model_evaluation.cases import CASES_FILE, read_cases


def test_answers_that_are_none_are_refused_with_a_reason(tmp_path: Path) -> None:
    (tmp_path / "answers.json").write_text("{}")
    (tmp_path / "catalogue.json").write_text('{"entries": []}')
    ran = CliRunner().invoke(
        app, ["evaluate", "--pictures", str(tmp_path), "--answers", str(tmp_path / "answers.json"), "--tasks", "1"]
    )
    assert ran.exit_code == 2
    assert "logisticsvln:" in ran.output


@pytest.mark.parametrize("about", [b"[1]", b"{", b"\xff"])
def test_what_lies_beside_the_answers_is_named_where_it_is_damaged(tmp_path: Path, about: bytes) -> None:
    (tmp_path / "answers.json").write_text('{"model": null, "sought": [], "counted": []}')
    (tmp_path / "about.json").write_bytes(about)
    ran = CliRunner().invoke(
        app, ["evaluate", "--pictures", str(tmp_path), "--answers", str(tmp_path / "answers.json")]
    )
    assert ran.exit_code == 2
    assert f"{tmp_path / 'about.json'} is not what `--out` writes" in ran.output.replace("\n", "")


def test_a_folder_that_is_no_run_is_refused(tmp_path: Path) -> None:
    ran = CliRunner().invoke(app, ["evaluate", "--flown", str(tmp_path), "--pictures", str(tmp_path)])
    assert ran.exit_code == 2
    assert str(tmp_path) in ran.output


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_streets_are_rendered_once_and_the_card_is_written(tmp_path: Path) -> None:
    pictures, out, docs = tmp_path / "pictures", tmp_path / "out", tmp_path / "docs"
    command = ["evaluate", "--tasks", "1", "--strange", "1", "--first-seed", "99990", "--pictures", str(pictures)]
    ran = CliRunner().invoke(app, [*command, "--out", str(out), "--card", str(docs), "--json"])
    assert ran.exit_code == 0, ran.output
    scores = json.loads(ran.stdout.strip().splitlines()[-1])
    assert (scores["tasks"], scores["strange"]) == (1, 1)
    assert scores["rates"]["no readable answer"]["k"] == 0
    cases = read_cases(pictures)
    assert {case.strange for case in cases.values()} == {False, True}
    assert all((pictures / name).is_file() for case in cases.values() for k in case.looks for name in k.pictures)
    assert "## What it does badly" in (docs / CARD).read_text()
    assert (docs / CURVES).stat().st_size > 10_000
    assert (docs / SHEET).is_file()

    with (pictures / CASES_FILE).open("a") as lines:
        lines.write('{"seed": 5, "looks')  # as a crash leaves it
    before = {path: path.stat().st_mtime_ns for path in pictures.rglob("*.jpg")}
    card = (docs / CARD).read_text()
    again = CliRunner().invoke(app, [*command, "--answers", str(out / "answers.json"), "--card", str(docs), "--json"])
    assert again.exit_code == 0, again.output
    assert (docs / CARD).read_text() == card
    assert json.loads(again.stdout.strip().splitlines()[-1])["rates"] == scores["rates"]
    assert before == {path: path.stat().st_mtime_ns for path in pictures.rglob("*.jpg")}
