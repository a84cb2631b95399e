"""From a noun phrase to the classes and the colour it means."""

import json
import re
from pathlib import Path
from typing import NamedTuple

from services.vlm_gateway.embedded.words import OutOfVocabulary

_COLOUR_WORDS = {
    "red": ("red", "crimson", "scarlet", "ruby", "reddish", "cherry"),
    "orange": ("orange", "tangerine", "amber"),
    "yellow": ("yellow", "golden", "gold", "lemon", "yellowish", "mustard"),
    "green": ("green", "greenish", "emerald", "lime", "olive"),
    "blue": ("blue", "navy", "azure", "bluish", "turquoise", "cobalt"),
    "purple": ("purple", "violet", "lilac", "mauve", "lavender"),
    "pink": ("pink", "rosy", "magenta", "pinkish"),
    "white": ("white", "whitish", "cream", "ivory"),
    "black": ("black", "blackish", "ebony"),
    "brown": ("brown", "tan", "brownish", "chestnut"),
}


class Wanted(NamedTuple):
    """Classes that the phrase may mean, best first, and the colour it asks for (null where it names none)."""

    kinds: tuple[str, ...]
    colour: str | None


class Vocabulary:
    """`kinds` in the order of the classifier's outputs, each with its phrases; `colours` in the table's order."""

    def __init__(
        self, kinds: dict[str, tuple[str, ...]], colours_of: dict[str, tuple[str, ...]], colours: tuple[str, ...]
    ):
        self.kinds = tuple(kinds)
        self.phrase_of = {kind: phrases[0] for kind, phrases in kinds.items()}
        self.colours = colours
        self.colours_of = colours_of
        self._phrases: dict[tuple[str, ...], list[str]] = {}
        for kind, phrases in kinds.items():
            for phrase in (kind.replace("_", " "), *phrases):
                known = self._phrases.setdefault(tuple(_singular(w) for w in _split(phrase)), [])
                if kind not in known:
                    known.append(kind)
        self._colour_words = {w: name for name, words in _COLOUR_WORDS.items() if name in colours for w in words}

    @classmethod
    def load(cls, path: Path) -> "Vocabulary":
        data = json.loads(path.read_text(encoding="utf-8"))
        entries = data["entries"]
        return cls(
            {e["kind"]: (e["phrase"], *e["synonyms"]) for e in entries},
            {e["kind"]: tuple(e["colours"]) for e in entries},
            tuple(data["colours"]),
        )

    def wanted(self, phrase: str) -> Wanted:
        """The longest run of words that names something decides; among equals the last, where the noun stands.

        Raises OutOfVocabulary.
        """
        words = [_singular(w) for w in _split(phrase)]
        for length in range(len(words), 0, -1):
            for first in range(len(words) - length, -1, -1):
                kinds = self._phrases.get(tuple(words[first : first + length]))
                if kinds:
                    # the nearest colour before the noun, else the first one after it ("a kite, bright blue")
                    return Wanted(tuple(kinds), self._colour([*reversed(words[:first]), *words[first + length :]]))
        raise OutOfVocabulary(f"nothing in {phrase!r} is a thing this model has learnt to see")

    def _colour(self, words: list[str]) -> str | None:
        return next((self._colour_words[w] for w in words if w in self._colour_words), None)


def _split(text: str) -> list[str]:
    return re.findall(r"[a-z0-9]+", text.lower().replace("coloured", " ").replace("colored", " ").replace("'s", ""))


def _singular(word: str) -> str:
    if len(word) > 3 and word.endswith("s") and not word.endswith(("ss", "us")):
        return word[:-1]
    return word
