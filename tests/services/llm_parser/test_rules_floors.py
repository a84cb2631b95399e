"""Floors in all the ways in which people say them, and the numbers that are none."""

import pytest

from services.llm_parser.rules.parser import parse

WAYS = {
    "on the seventh floor": 7,
    "7th floor": 7,
    "7th-floor window": 7,
    "the twenty-first floor": 21,
    "the twenty first floor": 21,
    "floor 7": 7,
    "floor: 7": 7,
    "Floor number 7": 7,
    "floor no. 7": 7,
    "level seven": 7,
    "lvl 7": 7,
    "storey 7": 7,
    "the seventh story": 7,
    "7th flr": 7,
    "7F": 7,
    "up on twelve": 12,
    "We're number 7!": 7,
    "I'm on the ninth": 9,
    "@ 7th floor": 7,
    "teh svnth flooor, i mean floor 7": 7,
    "the button in the lift says 7": 7,
    "seven floors up": 7,
    "ground floor": 1,
    "first floor": 1,
    "two floors above the fourth": 6,
    "two floors above the fourth floor": 6,
    "the floor below the tenth": 9,
    "just above the fourth floor": 5,
    "one floor up from the ground floor": 2,
    "three levels down from the twelfth": 9,
    "My mother is on the 4th floor, I'm one floor higher": 5,
    "the top floor of a nine-storey house": 9,
    "There are 18 floors and I live one below the top": 17,
    "There are 20 floors, I'm on the second from the top": 19,
    "the fourth, no sorry, the fifth floor": 5,
    "floor five no wait six": 6,
    "I wrote 5 on the form but in fact it is 7": 7,
    "not the 5th floor, the 6th floor": 6,
    "Floor 4. Correction: floor 14.": 14,
    "we moved from the third floor to the eighth floor": 8,
    "I used to live on the third floor, now I'm on the eighth floor": 8,
    "My neighbour is on the third floor, I'm on the fifth floor": 5,
    "don't go to the second floor, come to the third floor": 3,
    "a 22-storey tower, and I'm on the 13th floor": 13,
    "One kite is on the second floor, one on the third floor. Mine is the second one.": 3,
    "One kite is on the second floor, one on the third floor. Mine is the first one.": 2,
    "One kite is on the first floor, one on the third floor. My window is the last one.": 3,
    "There is a kite on the eighth floor of the tower. Mine is the first one you see.": 8,
}


@pytest.mark.parametrize(("request_", "floor"), WAYS.items(), ids=WAYS.keys())
def test_a_floor_is_understood(request_: str, floor: int) -> None:
    assert parse(request_).floor == floor


NO_FLOORS = [
    "apartment 1203",
    "the building has 22 storeys in total",
    "it cost £48.50",
    "come at 8:15 or 5pm",
    "my grandson is 7 years old",
    "call 555-0187",
    "order #58213",
    "the gate code is 4471",
    "built in 1974",
    "the 3rd of May",
    "on May 3rd",
    "my second window",
    "top floor",
    "ten minutes",
    "one of the windows",
    "number 44 Mill Lane",
    "two kites and three windows",
]


@pytest.mark.parametrize("request_", NO_FLOORS)
def test_a_number_that_is_no_floor_is_none(request_: str) -> None:
    answer = parse(request_)
    assert answer.floor is None
    assert "floor" in answer.missing


def test_only_the_neighbours_floor_is_nobodys_answer() -> None:
    assert parse("The neighbour on the third floor has my parcel.").floor is None


def test_the_evidence_is_the_words_that_say_the_floor() -> None:
    request = "I live on the third floor but the delivery goes two floors above the fourth floor, thanks."
    assert parse(request).evidence.floor == "two floors above the fourth floor"
    assert parse("Bring it to the TWENTY-first  Floor!").evidence.floor == "TWENTY-first  Floor"


def test_floors_stay_within_the_contract() -> None:
    assert parse("floor 200").floor == 200
    assert parse("floor 201").floor is None
    assert parse("floor 0").floor is None
    assert parse("five floors below the third floor").floor is None


@pytest.mark.parametrize(
    "request_",
    [
        "He says I must tell you the floor, which is the second, and something you can see.",
        "I said the second floor. No, not the third. The second. With a red kite.",
    ],
)
def test_a_floor_said_beside_its_noun_or_said_again_after_a_correction_counts(request_: str) -> None:
    assert parse(request_).floor == 2
