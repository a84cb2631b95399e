import pytest

from services.vlm_gateway.embedded.words import OutOfVocabulary, Vocabulary

WORDS = Vocabulary(
    {
        "flower_pot": ("planter", "flowerpot"),
        "cat_poster": ("poster of a cat",),
        "chair": (),
        "deck_chair": ("beach chair",),
        "parasol": ("beach umbrella",),
        "umbrella": (),
        "doll": (),
        "bananas": (),
        "lantern": ("hanging lantern",),
        "teapot": ("kettle",),
        "kettle_grill": ("kettle",),
    },
    ("blue", "brown", "green", "red"),
)


@pytest.mark.parametrize(
    ("phrase", "kind", "colour"),
    [
        ("green flower pot", "flower_pot", "green"),
        ("the big Crimson flower-pots", "flower_pot", "red"),
        ("flowerpot", "flower_pot", None),
        ("a beach chair", "deck_chair", None),
        ("brown chair", "chair", "brown"),
        ("navy-blue beach umbrella", "parasol", "blue"),
        ("poster of a cat in green", "cat_poster", "green"),
        ("green flower pot beside a red brick", "flower_pot", "green"),
        ("flower pot beside a red brick", "flower_pot", None),
        ("chair, bright blue", "chair", "blue"),
        ("red and green umbrella", "umbrella", "red"),
        ("red hanging lantern", "lantern", "red"),
        ("bunch of bananas", "bananas", None),
        ("the chair that is red", "chair", "red"),
    ],
)
def test_a_phrase_means_the_longest_name_at_its_head_and_the_colour_that_goes_with_it(
    phrase: str, kind: str, colour: str | None
) -> None:
    wanted = WORDS.wanted(phrase)
    assert wanted.kinds == (kind,)
    assert wanted.colour == colour


def test_a_word_for_two_classes_means_either() -> None:
    assert WORDS.wanted("red kettle").kinds == ("teapot", "kettle_grill")


def test_what_was_read_over_is_told() -> None:
    assert WORDS.wanted("chipped green flower pot").others == ("chipped",)


@pytest.mark.parametrize(
    "phrase",
    [
        "purple grand piano",
        "",
        "something green",
        "doll's house",
        "doll house",
        "flower pot stand",
        "window with a doll",
    ],
)
def test_a_phrase_whose_head_names_nothing_known_is_out_of_vocabulary(phrase: str) -> None:
    with pytest.raises(OutOfVocabulary, match="names nothing"):
        WORDS.wanted(phrase)


@pytest.mark.parametrize("phrase", ["grey flower pot", "purple chair", "a chair, silver"])
def test_a_colour_that_nobody_trained_on_is_not_guessed_at(phrase: str) -> None:
    with pytest.raises(OutOfVocabulary, match="no colour"):
        WORDS.wanted(phrase)
