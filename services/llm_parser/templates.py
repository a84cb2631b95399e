"""Request templates with slots, filled deterministically from a seed, and sentences with expected answers.

A template line is `{"id", "style", "template", "slots"}`; a sentence line is `{"id", "style", "request", "floor",
"object"}` with null for what the request does not say. Both may stand in one JSON-lines file.
"""

import json
import random
import string
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from services.llm_parser.rules.lexicon import words
from services.llm_parser.rules.numbers import number_word, ordinal_suffix, ordinal_word

OBJECTS = [
    "green flower pot",
    "red watering can",
    "blue umbrella",
    "poster of a cat",
    "cat poster",
    "yellow rubber duck",
    "teddy bear",
    "wind chime",
    "white garden gnome",
    "wooden chair",
    "bunch of bananas",
    "stack of books",
    "orange traffic cone",
    "rocking horse",
    "pair of red boots",
    "blue and white vase",
    "paper lantern",
    "string of fairy lights",
    "purple bicycle",
    "inflatable flamingo",
    "toolbox",
    "silver kettle",
    "pirate flag",
    "hand saw",
    "potted cactus",
    "birdcage",
    "striped beach towel",
    "stone lion statue",
    "hanging basket of ferns",
    "black cat figurine",
    "watermelon",
    "star-shaped balloon",
    "copper teapot",
    "pink piggy bank",
    "wicker basket",
    "map of the world",
    "skateboard",
    "brass telescope",
    "toy fire truck",
    "framed painting",
    "snow globe",
    "green dinosaur plush",
    "wooden ladder",
    "red and yellow kite",
    "jar of pickles",
    "spinning pinwheel",
    "leopard print cushion",
    "golden trophy",
    "grey elephant figurine",
    "ceramic owl",
    "Christmas wreath",
    "bicycle wheel",
    "hand drill",
    "pair of binoculars",
    "blue recycling bin",
    "red fire hydrant",
    "rubber plant",
    "set of wind chimes",
    "hanging plant",
    "bright yellow raincoat",
    "knitting basket",
    "Christmas tree",
    "sun lounger",
    "fishing rod",
    "drying rack",
    "ironing board",
    "baby stroller",
    "sleeping bag",
    "toy robot",
    "stop sign",
    "light bulb",
    "floor lamp",
    "alarm clock",
    "rolling pin",
    "cooking pot",
    "frying pan",
    "loaf of bread",
    "bottle of wine",
    "box of crayons",
    "crate of apples",
    "paper boat",
    "model airplane",
    "soccer ball",
    "spinning top",
    "jack-o'-lantern",
    "poster of a whale",
    "picture of a sailboat",
    "painting of a mountain",
    "print of a sunflower",
    "dream catcher",
    "wall clock",
    "window box",
    "door wreath",
    "bird feeder",
    "cardboard box",
    "gift box",
    "pizza box",
    "tea set",
    "chess set",
    "disco ball",
    "snow shovel",
    "step ladder",
    "tape measure",
    "screwdriver",
    "red and white striped awning",
    "green and yellow parasol",
    "weather vane",
    "plush rabbit",
    "stuffed elephant",
    "wooden duck",
    "cow skull",
    "solar panel",
    "satellite dish",
    "blue surfboard",
    "potted fern",
    "bouquet of roses",
    "basket of laundry",
    "pumpkin with a carved face",
    "statue of a horse",
    "dragon kite",
    "purple beanbag",
    "lava lamp",
    "movie poster",
    "world map poster",
    "orange life jacket",
    "rainbow flag",
    "big red button",
    "blue ceramic vase",
    "brown leather suitcase",
    "yellow hard hat",
    "large clay pot",
    "black typewriter",
    "wooden crate",
    "pink flamingo",
    "gold picture frame",
    "red lantern",
    "white bird cage",
    "toy castle",
    "superhero figurine",
    "stack of newspapers",
    "green bottle",
    "purple candle",
    "gray bucket",
    "orange pumpkin",
    "tricycle",
    "hammer",
    "ladder",
    "accordion",
    "saxophone",
    "bunting",
    "string of flags",
    "row of cacti",
    "banana bunch",
    "bowl of lemons",
    "rocking chair",
    "folding screen",
    "lucky cat",
    "fish tank",
    "bird bath",
    "knight's helmet",
    "witch's broom",
    "child's drawing",
    "polka-dot umbrella",
    "heart-shaped balloon",
]
"""What marks windows in the fills: many heads and shapes of phrase, most of them in no list of the grammar."""

PARCELS = [
    "groceries",
    "medicine",
    "book",
    "pizza",
    "birthday cake",
    "headphones",
    "parcel",
    "package",
    "laptop charger",
    "running shoes",
    "coffee beans",
    "prescription",
    "tool kit",
    "dog food",
    "box of chocolates",
    "printer paper",
]

_PLURALS = words("groceries medicine headphones running_shoes coffee_beans dog_food printer_paper")
TOP_FLOOR = 30


class Sample(NamedTuple):
    """One request with its right answer; None where the request does not say."""

    id: str
    style: str
    request: str
    floor: int | None
    object: str | None


class BadSamples(ValueError):
    """A line that is neither a template nor a sentence; the message names it."""


def read_samples(path: Path, *, seed: int = 0, fills: int = 3) -> Iterator[Sample]:
    """The samples of a file: each template filled `fills` times, each sentence once. Raises BadSamples, OSError."""
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        if not line.strip():
            continue
        try:
            entry = json.loads(line)
            name, style = str(entry["id"]), str(entry["style"])
            if "template" in entry:
                template = str(entry["template"])
                for fill in range(fills):
                    yield fill_template(name, style, template, random.Random(f"{seed}/{fill}/{name}"))
            else:
                yield Sample(name, style, str(entry["request"]), entry["floor"], entry["object"])
        except (ValueError, KeyError, TypeError) as error:
            raise BadSamples(f"{path}:{number}: neither a template nor a sentence ({error})") from error


def fill_template(name: str, style: str, template: str, chance: random.Random) -> Sample:
    """One filling of `template`. Raises KeyError for a slot that nobody knows."""
    floor, decoy_floor = chance.sample(range(1, TOP_FLOOR + 1), 2)
    thing, decoy = chance.sample(OBJECTS, 2)
    parcel = chance.choice(PARCELS)
    values = {
        "object": thing,
        "a_object": with_article(thing),
        "decoy_object": decoy,
        "a_decoy_object": with_article(decoy),
        "parcel": parcel,
        "a_parcel": parcel if parcel.replace(" ", "_") in _PLURALS else with_article(parcel),
    }
    for prefix, value in (("", floor), ("decoy_", decoy_floor)):
        values[f"{prefix}floor_number"] = str(value)
        values[f"{prefix}floor_word"] = number_word(value)
        values[f"{prefix}floor_ordinal"] = f"{value}{ordinal_suffix(value)}"
        values[f"{prefix}floor_ordinal_word"] = ordinal_word(value)
    slots = {field for _, field, _, _ in string.Formatter().parse(template) if field}
    return Sample(
        name,
        style,
        template.format_map(values),
        floor if any(s.startswith("floor") for s in slots) else None,
        thing if slots & {"object", "a_object"} else None,
    )


def with_article(noun_phrase: str) -> str:
    """ "a" or "an" in front, by the first letter."""
    return f"{'an' if noun_phrase[0].lower() in 'aeiou' else 'a'} {noun_phrase}"


def normalised(noun_phrase: str | None) -> str | None:
    """Lower case, single spaces, no article in front: what exact match compares."""
    if noun_phrase is None:
        return None
    words = noun_phrase.lower().split()
    return " ".join(words[1:] if words and words[0] in ("a", "an", "the") else words)
