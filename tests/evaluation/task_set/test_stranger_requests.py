"""Requests by strangers: every template can be filled, and no training data holds any of them."""

import json
import re
from pathlib import Path

import pytest

from contracts.sim import CatalogueEntry
from evaluation.task_set.stranger_requests import Wanted, filled_by_stranger, fits, stranger_templates

ROOT = Path(__file__).parents[3]
TRAINED_ON = [
    *sorted((ROOT / "training").rglob("*.jsonl")),
    ROOT / "evaluation" / "task_set" / "data" / "request_templates.jsonl",
]
TELLING = 18
"""Characters of a template between two slots that nobody else writes by chance."""


def entry(phrase: str = "flower pot") -> CatalogueEntry:
    return CatalogueEntry(
        kind="pot",
        category="ornaments",
        phrase=phrase,
        synonyms=(),
        colours=("orange",),
        places=("sill",),
        size_m=(0.3, 0.3, 0.3),
    )


def plain(text: str) -> str:
    return re.sub(r"\W+", " ", text.lower()).strip()


def test_every_template_is_filled_and_names_floor_and_object() -> None:
    wanted = Wanted(floor=12, entry=entry(), colour="orange", other_floor=3, decoy="red kite")
    assert len(stranger_templates()) == 220
    for template in stranger_templates():
        request = filled_by_stranger(template, wanted)
        assert "{" not in request
        assert "orange" in request
        assert "flower pot" in request
        assert any(word in request for word in ("12", "twelve", "twelfth")), request
        assert "a orange" not in request


def test_a_thing_whose_name_holds_its_colour_is_not_told_apart_from_it() -> None:
    apart = next(template for template in stranger_templates() if template.splits)
    together = next(template for template in stranger_templates() if not template.splits)
    odd = Wanted(floor=2, entry=entry("orange tree"), colour="orange", other_floor=3, decoy="red kite")
    assert not fits(apart, odd)
    assert fits(together, odd)
    assert fits(apart, odd._replace(entry=entry()))


@pytest.mark.parametrize("path", TRAINED_ON, ids=lambda path: path.name)
def test_no_training_data_holds_a_stranger_s_words(path: Path) -> None:
    text = plain(path.read_text(encoding="utf-8"))
    for template in stranger_templates():
        pieces = [plain(piece) for piece in re.split(r"\{[^}]*\}", template.text)]
        longest = max(pieces, key=len)
        if len(longest) >= TELLING:
            assert f" {longest} " not in f" {text} ", template.id


def test_the_comparison_would_find_a_template_that_was_trained_on() -> None:
    own = json.loads((TRAINED_ON[-1]).read_text(encoding="utf-8").splitlines()[0])["template"]
    longest = max((plain(piece) for piece in re.split(r"\{[^}]*\}", own)), key=len)
    assert longest in plain(TRAINED_ON[-1].read_text(encoding="utf-8"))
