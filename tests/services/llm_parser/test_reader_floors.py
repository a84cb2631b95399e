"""Mentions of numbers and what floors they could come to: arithmetic, without the network."""

import pytest

from services.llm_parser.reader.floors import ONE_OPERATIONS, PAIR_OPERATIONS, readings
from services.llm_parser.reader.mentions import MOST_MENTIONS, find_mentions


def values(text: str) -> list[int]:
    return [m.value for m in find_mentions(text) if m.kind in ("count", "ground", "sound")]


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("floor 4", [4]),
        ("4TH FLOOR", [4]),
        ("the twenty-first floor", [21]),
        ("the fourth", [4]),
        ("FLOOR.....07", [7]),
        ("F:11", [11]),
        ("6yh floor, 10tb flor", [6, 10]),
        ("the sevnth flor", [7]),
        ("the fiveth floor", [5]),
        ("#thirdfloor", [3]),
        ("2️⃣ floor", [2]),
        ("III piętro", [3]),
        ("ground floor, please", [1]),
        ("floor ate", [8]),
        ("i ate lunch", []),
        ("Suite 1501", [1501]),
        ("a line in the sink", []),
    ],
)
def test_numbers_are_found_however_they_are_written(text: str, found: list[int]) -> None:
    assert values(text) == found


def test_mentions_stand_where_they_say() -> None:
    text = "On the 3rd floor, not the Fifth."
    assert [text[m.start : m.end] for m in find_mentions(text)] == ["3rd", "Fifth"]


def test_a_text_of_numbers_has_a_bounded_number_of_mentions() -> None:
    assert len(find_mentions("one 2 three " * 300)) == MOST_MENTIONS


@pytest.mark.parametrize(
    ("text", "operation", "floor"),
    [
        ("two floors above the fourth", "add", 6),
        ("two below the sixth", "subtract", 4),
        ("third from the top of eight", "from_top", 6),
        ("first floor, ground not counted", "plus_1", 2),
        ("the one above the second", "plus_1", 3),
        ("room 915", "hundreds", 9),
        ("double of four", "times", 8),
    ],
)
def test_relative_floors_are_among_the_readings(text: str, operation: str, floor: int) -> None:
    names = {
        (ONE_OPERATIONS if r.second is None else PAIR_OPERATIONS)[r.operation]
        for r in readings(find_mentions(text))
        if r.floor == floor
    }
    assert operation in names


def test_no_reading_leaves_the_floors_there_are() -> None:
    assert all(1 <= r.floor <= 200 for r in readings(find_mentions("floor -1, 0, 999, 9999, one below the first")))
