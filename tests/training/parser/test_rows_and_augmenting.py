"""Labelled requests: labels are spans of the text, and stay so however a text is edited."""

from pathlib import Path

import numpy as np
import pytest

from services.llm_parser.reader.decode import content
from services.llm_parser.reader.floors import readings
from services.llm_parser.reader.mentions import find_mentions
from services.llm_parser.reader.model import About, Calibration, Calibrations, Thresholds
from training.parser.__main__ import BEFORE_MEASURING, measured
from training.parser.augment import Augmenter
from training.parser.made import Maker, Thing
from training.parser.measure import Calibrated, Examined, calibrated, card, outcomes
from training.parser.plot import draw
from training.parser.rows import Forms, Row, Span, load

REQUESTS = Path(__file__).parents[3] / "training" / "parser" / "requests"


@pytest.fixture(scope="module")
def rows() -> list[Row]:
    return load(sorted(REQUESTS.glob("*.jsonl")))


def test_every_request_is_labelled_within_its_own_text(rows: list[Row]) -> None:
    assert len(rows) == 15780
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


def test_edits_by_chance_keep_the_floor_within_reach(rows: list[Row]) -> None:
    edit = Augmenter(rows, np.random.default_rng(7))
    plain = [r for r in rows if r.floor is not None and not r.tags and r.floor_spans][:300]
    held = 0
    for row in plain:
        changed = edit(row)
        assert all(0 <= s.start <= s.end <= len(changed.text) for s in changed.labelled)
        reached = {r.floor for r in readings(find_mentions(changed.text))}
        held += changed.floor is None or changed.floor in reached
    assert held > 0.95 * len(plain)


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
    found = calibrated(examined)
    asking_nothing = found._replace(thresholds=Thresholds(floor=0.0, object=0.0))
    assert outcomes(examined, asking_nothing).wrong == pytest.approx(0.1)
    assert outcomes(examined, found) == pytest.approx((0.9, 0.1, 0.0))
    assert "| all | 100 |" in card(examined, found)


def test_thresholds_are_chosen_on_the_authors_that_are_named() -> None:
    def one(author: str, probability: float, right: bool) -> Examined:
        return Examined(
            author=author, tags=(), text="", floor=1, floor_probability=probability, floor_right=right, object="pot",
            object_probability=1.0, object_right=True,
        )  # fmt: skip

    fair, hard = [one("fair", 0.7, True)] * 100, [one("hard", 0.7, False)] * 100
    assert outcomes(fair, calibrated([*fair, *hard], ["fair"])) == pytest.approx((1.0, 0.0, 0.0))
    assert outcomes(fair, calibrated([*fair, *hard])) == pytest.approx((0.0, 1.0, 0.0))
    with pytest.raises(ValueError, match="no requests of nobody were examined"):
        calibrated(fair, ["nobody"])


def test_a_calibrated_probability_is_the_share_that_is_right() -> None:
    def one(probability: float, right: bool) -> Examined:
        return Examined(
            author="x", tags=(), text="", floor=1, floor_probability=probability, floor_right=right, object="pot",
            object_probability=0.9, object_right=True,
        )  # fmt: skip

    boastful = [one(0.99, k < 160) for k in range(200)] + [one(0.9, k < 100) for k in range(200)]
    floor = calibrated(boastful).calibration.floor
    assert floor.probability(0.99) == pytest.approx(0.8, abs=0.03)
    assert floor.probability(0.9) == pytest.approx(0.5, abs=0.03)


@pytest.mark.parametrize(
    ("text", "said", "floor"),
    [
        ("two floors above Tom on 3, red pot", "two floors above Tom on 3", 5),
        ("2nd floor, the ground is 0, red pot", "2nd floor", 3),
        ("the ninth floor, red pot", "ninth floor", 9),
    ],
)
def test_another_number_moves_the_floor_by_as_much(text: str, said: str, floor: int) -> None:
    at = text.index(said)
    row = Row(text, floor, "red pot", (), (Span(at, at + len(said)),), (), None, frozenset({"relative_floor"}))
    edit = Augmenter([], np.random.default_rng(3))
    changed = next(c for c in (edit._other_floor(row) for _ in range(20)) if c is not row)
    before, after = (sum(m.value for m in find_mentions(t) if m.kind == "count") for t in (text, changed.text))
    assert changed.floor is not None
    assert changed.floor - floor == after - before != 0


def test_made_requests_say_the_floor_that_they_are_labelled_with() -> None:
    maker, thing = Maker(np.random.default_rng(5)), Thing("red pot", "red pot", ())
    made = [row for row in (maker.request(thing) for _ in range(300)) if row is not None]
    told = [row for row in made if row.floor is not None]
    reached = [row for row in told if row.floor in {r.floor for r in readings(find_mentions(row.text))}]
    assert len(told) > 150
    assert len(reached) > 0.97 * len(told)


def test_what_was_measured_of_a_folder_is_kept_by_the_next_export(tmp_path: Path) -> None:
    assert measured(tmp_path) == BEFORE_MEASURING
    about = About(
        calibration=Calibrations(floor=Calibration(slope=0.5, offset=-0.1)),
        thresholds=Thresholds(floor=0.7, object=0.8),
    )
    (tmp_path / "about.json").write_text(about.model_dump_json())
    assert measured(tmp_path) == about


def test_the_curves_are_drawn(tmp_path: Path) -> None:
    examined = [
        Examined(
            author=author, tags=(), text="", floor=1, floor_probability=p, floor_right=p > 0.5, object="pot",
            object_probability=0.9, object_right=True,
        )
        for author in "xy"
        for p in (0.3, 0.6, 0.9, 0.99)
    ]  # fmt: skip
    found = Calibrated(Calibrations(), Thresholds(floor=0.5, object=0.5))
    losses = [{"floor": 1.0 / n, "object": 2.0 / n, "tags": 0.1, "relation": 0.1} for n in (1, 2, 3)]
    draw(losses, examined, found, tmp_path / "curves.png")
    assert (tmp_path / "curves.png").read_bytes().startswith(b"\x89PNG")
