"""What of a request is mended before it is read, and what is left alone."""

import time

import pytest

from services.llm_parser.reader.model import ReaderModel
from services.llm_parser.reader.parser import WEIGHTS
from services.llm_parser.reader.spelling import Spelling


@pytest.fixture(scope="module")
def spelling() -> Spelling:
    return ReaderModel(WEIGHTS).spelling


@pytest.mark.parametrize(
    ("written", "meant"),
    [
        ("red umberella in the windwo", "red umbrella in the window"),
        ("NINTH FLOR RED TELPHONE IN THE WINDWO", "NINTH FLOR RED TELEPHONE IN THE WINDOW"),
        ("a yelow sunflowr, plastick", "a yellow sunflower, plastic"),
        ("a litle umbrela by the windwo, pleese", "a little umbrella by the window, please"),
        ("the fust floor, sevent floor, therd flr", "the first floor, seventh floor, third flr"),
        ("my windwo, with the farmacy sign and the pengiun", "my window, with the pharmacy sign and the penguin"),
    ],
)
def test_slips_are_mended(spelling: Spelling, written: str, meant: str) -> None:
    assert spelling.mended(written).text == meant


@pytest.mark.parametrize(
    "written",
    [
        "The window with the tulsi plant on the fourth floor",
        "Mr Okonkwo's kite is on 2, ours is the jollof pot sign on 3",
        "Peackok Lane 4: mine is the toran over the window, parter",
        "the didgeridoo-shaped lamp, don't ring, doesnt matter",
        "the umberella in the fourth window",
        "It is 5 at level crossing 12 on floor 3, the wooden floor, 2 my floor",
        "https://exmaple.com/windwo @windwo #windwo",
        "",
    ],
)
def test_names_rare_words_and_a_single_unknown_one_are_left_alone(spelling: Spelling, written: str) -> None:
    assert spelling.mended(written).text == written


def test_a_number_stays_the_number_that_it_was_read_as(spelling: Spelling) -> None:
    assert spelling.mended("the thrid floor, a litle umbrela").text == "the third floor, a little umbrella"


def test_what_was_written_is_found_again(spelling: Spelling) -> None:
    written = "Floor 4, the umberella in the windwo, thnaks"
    mended = spelling.mended(written)
    start = mended.text.index("umbrella")
    assert mended.written(written, start, start + len("umbrella")) == "umberella"
    start = mended.text.index("window")
    assert mended.written(written, start, start + len("window")) == "windwo"
    assert mended.written(written, 0, len(mended.text)) == written
    assert mended.written(written, 3, 3) == ""


def test_a_long_request_of_unknown_words_is_mended_in_time(spelling: Spelling) -> None:
    words = [f"{a}{b}zqx{c}w" for a in "bcdfghjklmnp" for b in "aeiouy" for c in "bcdfghjklmnp"]
    started = time.process_time()
    spelling.mended("umberella windwo " + " ".join(words) * 5)
    assert time.process_time() - started < 3.0
