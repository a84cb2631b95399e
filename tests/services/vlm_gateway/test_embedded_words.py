import pytest

from services.vlm_gateway.embedded.words import OutOfVocabulary, Vocabulary

WORDS = Vocabulary(
    {
        "flower_pot": ("flower pot", "planter"),
        "cat_poster": ("cat poster", "poster of a cat"),
        "chair": ("chair",),
        "deck_chair": ("deck chair", "beach chair"),
        "parasol": ("parasol", "beach umbrella"),
        "umbrella": ("umbrella",),
    },
    {},
    ("blue", "brown", "green", "red"),
)


@pytest.mark.parametrize(
    ("phrase", "kind", "colour"),
    [
        ("green flower pot", "flower_pot", "green"),
        ("the big Crimson flower-pots", "flower_pot", "red"),
        ("a beach chair", "deck_chair", None),
        ("brown chair", "chair", "brown"),
        ("navy-blue beach umbrella", "parasol", "blue"),
        ("poster of a cat in green", "cat_poster", "green"),
        ("green flower pot beside a red brick", "flower_pot", "green"),
    ],
)
def test_a_phrase_means_the_longest_name_in_it_and_the_colour_next_to_it(
    phrase: str, kind: str, colour: str | None
) -> None:
    wanted = WORDS.wanted(phrase)
    assert wanted.kinds == (kind,)
    assert wanted.colour == colour


@pytest.mark.parametrize("phrase", ["purple grand piano", "", "something green"])
def test_a_phrase_that_names_nothing_known_is_out_of_vocabulary(phrase: str) -> None:
    with pytest.raises(OutOfVocabulary):
        WORDS.wanted(phrase)
