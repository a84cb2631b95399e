"""`python -m services.llm_parser.evaluate`: figures that repeat, clear words for a bad file."""

import json
from pathlib import Path

import pytest

from services.llm_parser.evaluate import main
from services.llm_parser.templates import normalised, read_samples

TEMPLATES = Path(__file__).parents[2] / "data" / "request_templates.jsonl"
KITE = "Floor 3, the window with the red kite."


@pytest.fixture
def mixed(tmp_path: Path) -> Path:
    """A template, a sentence that is read rightly and one whose expected answer is wrong on purpose."""
    path = tmp_path / "mixed.jsonl"
    lines = [
        {"id": "a", "style": "plain", "template": "Floor {floor_number}, look for {a_object}.", "slots": []},
        {
            "id": "b",
            "style": "terse",
            "request": KITE,
            "floor": 3,
            "object": "Red kite",
        },
        {"id": "c", "style": "terse", "request": KITE, "floor": 4, "object": None},
    ]
    path.write_text("\n".join(json.dumps(line) for line in lines), encoding="utf-8")
    return path


def test_templates_are_filled_and_sentences_counted_by_style(mixed: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(mixed), "--fills", "2", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["overall"]["samples"] == 4
    assert found["by_style"]["plain"]["floor_exact"] == 1.0
    assert found["by_style"]["terse"] == {
        "samples": 2, "floors": 1, "objects": 1, "floor_exact": 0.5, "object_exact": 0.5,
    }  # fmt: skip
    assert [failure["id"] for failure in found["failures"]] == ["c"]


def test_for_people_each_failure_says_what_was_expected(mixed: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(mixed)]) == 0
    shown = capsys.readouterr().out
    assert "floor 4 read as 3; object None read as 'red kite'" in shown
    assert "all" in shown.splitlines()[-1]


def test_fillings_repeat_with_the_seed_and_differ_between_seeds() -> None:
    first, again, other = (list(read_samples(TEMPLATES, seed=seed, fills=1)) for seed in (1, 1, 2))
    assert first == again
    assert first != other


def test_every_filling_holds_its_own_answer_and_no_open_slot() -> None:
    for sample in read_samples(TEMPLATES, seed=3, fills=1):
        assert sample.object is not None
        assert sample.object in sample.request
        assert "{" not in sample.request


@pytest.mark.parametrize("line", ["{", '{"id": "a"}', '{"id": "a", "style": "s", "template": "{nothing_known}"}', "[]"])
def test_a_line_that_is_no_sample_is_named(tmp_path: Path, line: str, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "bad.jsonl"
    path.write_text("\n" + line, encoding="utf-8")
    assert main([str(path)]) == 2
    assert "bad.jsonl:2" in capsys.readouterr().err


def test_a_missing_file_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(tmp_path / "none.jsonl")]) == 2
    assert "none.jsonl" in capsys.readouterr().err


def test_objects_are_compared_without_article_case_and_spacing() -> None:
    assert normalised("The  Red Kite") == normalised("red kite") == "red kite"
    assert normalised("theatre mask") == "theatre mask"
    assert normalised(None) is None
