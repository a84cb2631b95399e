"""Labelled requests: labels are spans of the text, and stay so however a text is edited."""

from pathlib import Path

import numpy as np
import pytest

from services.llm_parser.reader.decode import content
from services.llm_parser.reader.mentions import find_mentions
from training.parser.augment import Augmenter
from training.parser.measure import Examined, Pair, calibrated, card, outcomes
from training.parser.rows import Forms, Row, Span, load

REQUESTS = Path(__file__).parents[3] / "training" / "parser" / "requests"


@pytest.fixture(scope="module")
def rows() -> list[Row]:
    return load(sorted(REQUESTS.glob("*.jsonl")))


def test_every_request_is_labelled_within_its_own_text(rows: list[Row]) -> None:
    assert len(rows) == 5514
    for row in rows:
        assert all(0 <= s.start < s.end <= len(row.text) for s in row.labelled), row.text


def test_no_request_kept_apart_is_among_them(rows: list[Row]) -> None:
    texts = {row.text for row in rows}
    kept = load([Path(__file__).parents[2] / "data" / "requests_kept_apart.jsonl"])
    assert not texts & {row.text for row in kept}


def test_a_replaced_word_moves_the_labels_behind_it() -> None:
    row = Row("the fifth floor, red pot", 5, "red pot", (), (Span(4, 15),), (Span(17, 24),), None)
    changed = row.replaced(Span(4, 9), "twenty-first")
    assert [changed.text[slice(*s)] for s in changed.labelled] == ["twenty-first floor", "red pot"]


def test_edits_by_chance_keep_the_floor_within_its_words(rows: list[Row]) -> None:
    edit = Augmenter(rows, np.random.default_rng(7))
    plain = [r for r in rows if r.floor is not None and not r.tags and r.floor_spans][:300]
    held = 0
    for row in plain:
        changed = edit(row)
        assert all(0 <= s.start <= s.end <= len(changed.text) for s in changed.labelled)
        values = {
            m.value
            for m in find_mentions(changed.text)
            if any(s.start < m.end and m.start < s.end for s in changed.floor_spans)
        }
        held += changed.floor in values
    assert held > 0.9 * len(plain)


@pytest.mark.parametrize(("found", "right"), [("red clay pot", True), ("pot", True), ("blue jug", False), ("", False)])
def test_an_object_is_right_between_its_short_and_its_full_form(found: str, right: bool) -> None:
    row = Row("a red clay pot", None, "red clay pot", ("pot",), (), (Span(2, 14),), None)
    assert Forms(row).right(content(found)) == right


def test_thresholds_leave_few_silent_errors() -> None:
    def one(probability: float, right: bool) -> Examined:
        return Examined(
            author="x", tags=(), text="", floor=1, floor_probability=probability, floor_right=right, object="pot",
            object_probability=1.0, object_right=True,
        )  # fmt: skip

    examined = [one(0.99, True)] * 90 + [one(0.6, False)] * 10
    assert outcomes(examined, Pair(floor=0.0, object=0.0)).wrong == pytest.approx(0.1)
    found = calibrated(examined)
    assert outcomes(examined, found.thresholds) == pytest.approx((0.9, 0.1, 0.0))
    assert "| all | 100 |" in card(examined, found)
