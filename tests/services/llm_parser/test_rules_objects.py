"""The object: where its phrase begins and ends, and which of several things marks the window."""

import pytest

from services.llm_parser.rules.parser import parse

PHRASES = {
    "a green flower pot": "green flower pot",
    "the poster of a cat": "poster of a cat",
    "a bunch of bananas": "bunch of bananas",
    "a wooden chair with red cushion": "wooden chair with red cushion",
    "a cactus in a pot": "cactus in a pot",
    "a blue and white vase": "blue and white vase",
    "a black-and-white cat figurine": "black-and-white cat figurine",
    "a watering can": "watering can",
    "a red watering can": "red watering can",
    "a hand saw": "hand saw",
    "a teddy bear": "teddy bear",
    "a hanging basket of ferns": "hanging basket of ferns",
    "an old rocking horse": "old rocking horse",
    "my lovely pink piggy bank": "pink piggy bank",
    "a witch's broom": "witch's broom",
    "a jack-o'-lantern": "jack-o'-lantern",
    "a zorbulon": "zorbulon",
    "two red chairs": "two red chairs",
    "the map of the world": "map of the world",
    "a bedside clock": "bedside clock",
    "a brolly": "brolly",
    "a cuddly bear": "cuddly bear",
    "a donut": "donut",
    "an easy chair": "easy chair",
    "an open umbrella": "open umbrella",
    "a travel case": "travel case",
    "a red fuel can": "red fuel can",
    "the gas can": "gas can",
    "a poster with a heart": "poster with a heart",
    "a snow man": "snow man",
    "a five-pointed star": "five-pointed star",
    "the three-legged stool": "three-legged stool",
    "a two-handled vase": "two-handled vase",
    "a stop sign": "stop sign",
    "a no parking sign": "no parking sign",
    "a portrait of a lady": "portrait of a lady",
    "a polka-dot tablecloth": "polka-dot tablecloth",
    "a red and white parasol": "red and white parasol",
    "a butterfly ornament": "butterfly ornament",
}


@pytest.mark.parametrize(("said", "name"), PHRASES.items(), ids=PHRASES.keys())
@pytest.mark.parametrize(
    "request_",
    [
        "Please look for {} at my window on the fifth floor.",
        "My window has {}.",
        "okay so there's {} by my window thanks bye",
        "5th floor, the window with {}",
        "The window is next to {} that my aunt gave me, fifth floor",
    ],
)
def test_a_thing_is_named_in_full_and_nothing_more(request_: str, said: str, name: str) -> None:
    assert parse(request_.format(said)).object == name


CHOICES = {
    "Look for the red kite, not the blue umbrella.": "red kite",
    "Not the blue umbrella. The red kite.": "red kite",
    "My neighbour has a blue umbrella, I have a red kite.": "red kite",
    "Ignore the blue umbrella; my window is the one with the red kite.": "red kite",
    "The red kite is mine, the blue umbrella is my neighbour's.": "red kite",
    "blue umbrella = not mine, red kite = mine": "red kite",
    "If you see a blue umbrella, that's the wrong window. Ours has a red kite.": "red kite",
    "One window has a red kite, the other has a blue umbrella. Mine is the first one.": "red kite",
    "One window has a blue umbrella, the other has a red kite. Mine is the second one.": "red kite",
    "Look for the blue umbrella, sorry, I mean the red kite.": "red kite",
    "There used to be a blue umbrella at my window, now there is a red kite.": "red kite",
    "Please bring my blue umbrella to the window with the red kite.": "red kite",
    "I'm waiting for the headphones I ordered. There's a red kite outside.": "red kite",
    "I put a red kite at the window so that you find me. Leave the pizza there.": "red kite",
    "There's a red kite. It's at my window. The kite is hard to miss.": "red kite",
    "windwo wiht teh red kite": "red kite",
    "its the window w/ the red kite 🪁 lol": "red kite",
}


@pytest.mark.parametrize(("request_", "name"), CHOICES.items(), ids=CHOICES.keys())
def test_of_several_things_the_customers_mark_is_chosen(request_: str, name: str) -> None:
    assert parse(request_).object == name


@pytest.mark.parametrize(
    "request_",
    [
        "Please bring my pizza to the ninth floor.",
        "Where is my order?",
        "The window on the fifth floor, please.",
        "Leave the medicine at my balcony, level 3.",
        "Not the red kite!",
        "My neighbour has a red kite.",
        "Hello, good morning and thank you very much!",
        "My dog barks a lot. Second floor.",
        "I have a headache and I'm on the 4th floor.",
        "Floor 5. It's an emergency.",
        "Leave it at the reception desk.",
        "Floor 12, thank you so much, you're a lifesaver.",
    ],
)
def test_where_no_mark_is_named_none_is_made_up(request_: str) -> None:
    answer = parse(request_)
    assert answer.object is None
    assert "object" in answer.missing
    assert answer.evidence.object is None


def test_the_evidence_is_the_requests_own_spelling() -> None:
    assert parse("LOOK FOR THE Red Kite AT MY WINDOW").evidence.object == "THE Red Kite"


@pytest.mark.parametrize(
    "piece", ["a ", "kite, ", "not the ", "seventh floor ", "1.1", "(", "of with ", "😀", "x'", "\n"]
)
def test_long_monotonous_requests_are_answered_like_any_other(piece: str) -> None:
    assert parse((piece * 4000)[:4000]).outcome == "answered"


@pytest.mark.parametrize("request_", ["floor 4, boombox", "gramophone, floor 4", "Floor twelve and a gramophone."])
def test_a_thing_that_stands_alone_is_taken_for_the_mark(request_: str) -> None:
    assert parse(request_).object in ("boombox", "gramophone")


@pytest.mark.parametrize("request_", ["asdf qwer", "floor 3, asdf", "qwerty fghj, fourth floor", "zxcvb", "blue door"])
def test_fingers_on_the_keyboard_and_doors_mark_no_window(request_: str) -> None:
    assert parse(request_).object is None
