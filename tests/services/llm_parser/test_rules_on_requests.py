"""The grammar on whole requests: the templates with many fillings, and sentences of our own."""

import json
from pathlib import Path

import pytest

from services.llm_parser.evaluate import evaluate
from services.llm_parser.templates import read_samples

DATA = Path(__file__).parents[2] / "data"


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_templates_are_read_exactly_nine_times_in_ten_or_more(seed: int) -> None:
    found = evaluate(read_samples(DATA / "request_templates.jsonl", seed=seed, fills=2))
    assert found.overall.samples == 520
    assert found.overall.floor_share >= 0.97
    assert found.overall.object_share >= 0.93
    assert all(score.floor_share >= 0.9 for score in found.by_style.values()), found.by_style
    assert all(score.object_share >= 0.8 for score in found.by_style.values()), found.by_style


def test_further_templates_in_other_words_are_read_as_well() -> None:
    found = evaluate(read_samples(DATA / "request_templates_further.jsonl", seed=4, fills=3))
    assert found.overall.samples >= 200
    assert found.overall.floor_share >= 0.95
    assert found.overall.object_share >= 0.92


@pytest.mark.parametrize("half", ["A", "B"])
def test_templates_by_another_author_are_read_as_well(half: str, tmp_path: Path) -> None:
    """Half A mended the grammar. Half B was first read when that was done: floor 93.9 %, object 91.1 % of six fills."""
    lines = (DATA / "request_templates_blind.jsonl").read_text(encoding="utf-8").splitlines()
    chosen = [line for line in lines if json.loads(line)["half"] == half]
    file = tmp_path / "half.jsonl"
    file.write_text("\n".join(chosen), encoding="utf-8")
    found = evaluate(read_samples(file, seed=5, fills=3))
    assert found.overall.samples >= 240
    assert found.overall.floor_share >= 0.9
    assert found.overall.object_share >= 0.8


def test_sentences_of_our_own_are_read_as_well() -> None:
    found = evaluate(read_samples(DATA / "request_sentences.jsonl"))
    assert found.overall.samples >= 110
    assert found.overall.floor_share >= 0.95
    assert found.overall.object_share >= 0.93


def test_what_requests_do_not_say_is_never_invented() -> None:
    samples = [s for s in read_samples(DATA / "request_sentences.jsonl") if s.floor is None or s.object is None]
    assert len(samples) >= 8
    wrong = [failure.request for failure in evaluate(samples).failures]
    assert wrong == []
