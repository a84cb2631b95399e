"""From scores to an object: what is said of it elsewhere belongs to it, what is said of others does not."""

import re

import numpy as np
import pytest

from services.llm_parser.reader import decode
from services.llm_parser.reader.decode import FloorGuess, Scores, Tokens

WIDTH = 24


def named(text: str, thing: str, colour: str) -> str | None:
    """The phrase where the network is sure of the span `thing`, and half sure that `colour` belongs to it."""
    offsets = [m.span() for m in re.finditer(r"\w+|[^\w\s]", text)]
    words = [text[slice(*o)] for o in offsets]
    spans = np.full((len(words), WIDTH), -9.0, np.float32)
    spans[words.index(thing.split()[0]), len(thing.split()) - 1] = 9.0
    tags = np.full(len(words), -9.0, np.float32)
    tags[words.index(colour)] = 1.0
    scores = Scores(np.zeros(12, np.float32), np.zeros((1, 7)), np.zeros((1, 1, 6)), spans, spans, tags)
    return decode.objects(scores, Tokens(text, offsets), FloorGuess(None, 1.0))[0].phrase


@pytest.mark.parametrize(
    ("text", "thing", "colour", "phrase"),
    [
        ("Floor 2, the umbrella on the rail. Red, by the way.", "umbrella", "Red", "red umbrella"),
        (
            "Chairs everywhere. Mine is the rocking chair, the purple one.",
            "rocking chair",
            "purple",
            "purple rocking chair",
        ),
        ("My ballet shoes hang there, pink they were. Floor 3.", "ballet shoes", "pink", "pink ballet shoes"),
        ("Kyle has a gold trophy. I have the ribbon, floor 2.", "ribbon", "gold", "ribbon"),
        ("Fourth floor, red brick, swan planter", "swan planter", "red", "swan planter"),
    ],
)
def test_a_colour_said_elsewhere_is_the_objects_unless_it_stands_before_another_thing(
    text: str, thing: str, colour: str, phrase: str
) -> None:
    assert named(text, thing, colour) == phrase
