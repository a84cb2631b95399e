"""The learned reader with its shipped weights: what it answers, what it asks, and how an answer goes on."""

import pytest

from contracts.llm_parser import Exchange, ParseAnswer, ParseQuestion
from services.llm_parser.reader.model import ReaderModel
from services.llm_parser.reader.parser import WEIGHTS, ReaderParser


@pytest.fixture(scope="module")
def parser() -> ReaderParser:
    return ReaderParser(ReaderModel(WEIGHTS))


def read(
    parser: ReaderParser, request: str, *exchanges: tuple[str, str], ground_floor: int | None = None
) -> ParseAnswer:
    said = tuple(Exchange(question=q, answer=a) for q, a in exchanges)
    return parser.read(
        ParseQuestion.model_validate({"request": request, "exchanges": said, "ground_floor": ground_floor})
    )


@pytest.mark.parametrize(
    ("request_text", "floor", "thing"),
    [
        ("Please bring my parcel to the fourth floor, the window with the green flower pot.", 4, "green flower pot"),
        ("4TH FLOOR, THE WINDOW WITH THE RED UMBRELLA", 4, "red umbrella"),
        ("umbrella (red), 3rd floor", 3, "red umbrella"),
        ("Third floor. Look for the umbrella on my balcony. It's red.", 3, "red umbrella"),
        ("5th floor, the window with a bicycle - orange", 5, "orange bicycle"),
        ("Fourth floor, window with the cactus. My door is green by the way.", 4, "cactus"),
        ("ignore the yellow one. mine is the red umbrella, floor 3, round the back", 3, "red umbrella"),
        ("We live on the second floor and there is a brown teddy bear at our window.", 2, "brown teddy bear"),
        (
            "My neighbour on the third has a blue kite. I'm on the fifth floor, the window with the yellow lamp.",
            5,
            "yellow lamp",
        ),
        ("Hello pet, fifth floor, the nativity set in the window. One turkey crown.", 5, "nativity set"),
    ],
)
def test_plain_requests_are_read(parser: ReaderParser, request_text: str, floor: int, thing: str) -> None:
    answer = read(parser, request_text)
    assert (answer.floor, answer.object, answer.missing) == (floor, thing, ())
    assert answer.question is None


def test_evidence_is_in_the_requests_own_words(parser: ReaderParser) -> None:
    request = "Please bring my parcel to the fourth floor, the window with the Green Flower Pot."
    evidence = read(parser, request).evidence
    assert evidence.floor == "fourth"
    assert evidence.object is not None
    assert "Green Flower Pot" in evidence.object


@pytest.mark.parametrize(
    "request_text",
    [
        "The window with the green flower pot on the 4th or 5th floor.",
        "Flat 3/2, the window with the green flower pot.",
        "Third from the top, the window with the green flower pot.",
        "Bring it to the window with the green flower pot, please.",
    ],
)
def test_a_floor_that_is_not_said_is_asked_for(parser: ReaderParser, request_text: str) -> None:
    answer = read(parser, request_text)
    assert answer.floor is None
    assert "floor" in answer.missing
    assert answer.reasons.floor is not None
    assert answer.question is not None
    assert "floor" in answer.question


def test_a_window_told_by_another_one_is_a_relation(parser: ReaderParser) -> None:
    answer = read(parser, "Third floor, my window is just left of the one with the red teapot.")
    assert answer.object is None
    assert answer.relation is not None
    assert (answer.relation.side, answer.relation.count) == ("left", 1)
    assert "red teapot" in answer.relation.to


def test_another_language_is_told_in_that_language(parser: ReaderParser) -> None:
    answer = read(parser, "Bitte in den vierten Stock, das Fenster mit dem grünen Blumentopf")
    assert (answer.language, answer.reasons.floor, answer.floor) == ("de", "other_language", None)
    assert answer.question is not None
    assert "Englisch" in answer.question


def test_an_answer_to_the_question_completes_the_request(parser: ReaderParser) -> None:
    request = "Bring it to the window with the green flower pot, please."
    asked = read(parser, request).question or ""
    answer = read(parser, request, (asked, "the fifth"))
    assert (answer.floor, answer.object, answer.missing) == (5, "green flower pot", ())


def test_an_answer_that_says_nothing_is_asked_again(parser: ReaderParser) -> None:
    request = "Bring it to the window with the green flower pot, please."
    answer = read(parser, request, ("Which floor is the window on?", "I'm not sure"))
    assert answer.floor is None
    assert answer.question is not None


def test_how_a_first_floor_counts_is_a_setting_of_the_request(parser: ReaderParser) -> None:
    request = "First floor, the window with the green flower pot."
    assert read(parser, request).floor == 1
    assert read(parser, request, ground_floor=0).floor == 2


@pytest.mark.parametrize("request_text", ["?", "🙂", "x" * 4000, "7 " * 2000, "\u0000\n\t", "a" * 300 + " 4"])
def test_nothing_that_can_be_written_breaks_it(parser: ReaderParser, request_text: str) -> None:
    answer = read(parser, request_text)
    assert set(answer.missing) == {n for n in ("floor", "object") if getattr(answer, n) is None}
