"""What the customer is asked, and what people are told whose language is not read."""

import pytest

from contracts.llm_parser import Candidates, Reasons, Relation
from services.llm_parser.asking import question_for
from services.llm_parser.languages import SAID, other_language

NOTHING = Candidates()


def test_nothing_is_asked_where_nothing_is_missing() -> None:
    assert question_for(Reasons(), NOTHING, None) is None


def test_a_missing_floor_is_asked_for() -> None:
    assert question_for(Reasons(floor="not_said"), NOTHING, None) == "Which floor is the window on?"


def test_two_floors_are_offered_to_choose_from() -> None:
    asked = question_for(Reasons(floor="open"), Candidates(floors=(4, 5)), None)
    assert asked == "Is the window on the 4th or the 5th floor (the one at street level is the 1st)?"


def test_two_things_are_offered_to_choose_from() -> None:
    asked = question_for(Reasons(object="open"), Candidates(objects=("red pot", "blue pot")), None)
    assert asked == "Is your window the one with the red pot or the blue pot?"


def test_a_window_told_by_its_neighbour_needs_a_mark_of_its_own() -> None:
    asked = question_for(Reasons(object="relation_only"), NOTHING, Relation(to="red teapot", side="left"))
    assert asked == "Your window is left of the one with the red teapot: what can be seen at your own window?"


def test_both_are_asked_for_in_one_question() -> None:
    asked = question_for(Reasons(floor="not_said", object="not_said"), NOTHING, None)
    assert asked == "Which floor is the window on? And what can be seen at your window from outside?"


@pytest.mark.parametrize(
    ("language", "text"),
    [
        ("de", "Bitte in den vierten Stock, das Fenster mit dem grünen Blumentopf"),
        ("fr", "au quatrième étage, la fenêtre avec le pot de fleurs vert"),
        ("es", "por favor al cuarto piso, la ventana con la maceta verde"),
        ("pt", "por favor no quarto andar, a janela com o vaso de flores verde"),
        ("it", "al quarto piano, la finestra con il vaso di fiori verde per favore"),
        ("zh", "四楼，绿色花盆的窗户"),
        ("ja", "4階の緑の植木鉢の窓です"),
        ("ru", "четвёртый этаж, окно с зелёным горшком"),
        ("ar", "الطابق الرابع، النافذة التي بها أصيص أخضر"),
        ("hi", "चौथी मंजिल, हरे गमले वाली खिड़की"),
    ],
)
def test_other_languages_are_recognised(language: str, text: str) -> None:
    found = other_language(text)
    assert found is not None
    assert found.code == language
    assert SAID[language]


@pytest.mark.parametrize(
    "text",
    [
        "In Poland we say III piętro, in the window stands a red lamp",
        "teh 4th flor, gren umbrela",
        "4",
        "🏢 4 🪟 lamp",
        "2.OG links!! zweites Obergeschoss = third level with EG. in english red water can",
    ],
)
def test_english_with_mistakes_and_foreign_words_is_english(text: str) -> None:
    assert other_language(text) is None
