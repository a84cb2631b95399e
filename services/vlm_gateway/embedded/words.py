"""From a noun phrase to the classes and the colour it means, or to a plain word that it means nothing known.

The catalogue's own phrases and synonyms are all the vocabulary there is. What names a thing must be the phrase's head:
a doll's house is no doll, and a colour nobody trained on is no colour to guess at.
"""

import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple

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


def _all_of(words: str) -> frozenset[str]:
    return frozenset(words.split())


_STRANGE_COLOURS = _all_of(
    "grey gray silver silvery beige teal transparent colourless colorless bronze copper khaki rainbow"
)
_OTHERS_BEGIN = _all_of(
    "with on in beside by near next at under below behind above over between against from of that which who "
    "whose to hanging standing sitting leaning lying placed mounted stuck shaped made painted and or not but "
    "outside inside , ."
)
"""Words that end the part of a phrase in which its thing is named."""
_STILL_ITS_COLOUR = _all_of("in painted that which is , a an the and all bright dark light pale deep")
_ADJECTIVES = _all_of("big small large little tiny huge tall old new pretty bright dark light pale deep and hanging")
_TRAILING = _all_of("one please there here thing object item itself")
_MEASURES = _all_of("bunch pair set cluster group bundle couple piece row")
_ARTICLES = _all_of("a an the some my our your his her their this")


class OutOfVocabulary(ValueError):
    """The phrase names nothing that the model was trained on; the message says what."""


class Wanted(NamedTuple):
    """Classes that the phrase may mean, the colour it asks for (null where it names none), and further words that were
    read over."""

    kinds: tuple[str, ...]
    colour: str | None
    others: tuple[str, ...] = ()


class _Name(NamedTuple):
    first: int
    last: int
    kinds: tuple[str, ...]


class Vocabulary:
    """Classes with the phrases and synonyms they go by, and the colours that were trained on."""

    def __init__(self, names: Mapping[str, Sequence[str]], colours: Sequence[str]) -> None:
        self._kinds: dict[str, list[str]] = {}
        self._longest = 1
        for kind, phrases in names.items():
            for phrase in (kind.replace("_", " "), *phrases):
                words = _words(phrase)
                self._longest = max(self._longest, 2 * len(words))
                known = self._kinds.setdefault("".join(words), [])
                if kind not in known:
                    known.append(kind)
        self._colours = {w: name for name, words in _COLOUR_WORDS.items() if name in colours for w in words}
        untrained = {w for name, words in _COLOUR_WORDS.items() if name not in colours for w in words}
        self._strange = _STRANGE_COLOURS | untrained

    def wanted(self, phrase: str) -> Wanted:
        """Raises OutOfVocabulary."""
        words = _unmeasured(_words(phrase))
        head = self._head(words)
        if head is None:
            raise OutOfVocabulary(f"{phrase!r} names nothing that this model has learnt to see")
        before, after = words[: head.first], words[head.last :]
        strange = next((w for w in [*before, *self._its_own(after)] if w in self._strange), None)
        if strange is not None:
            raise OutOfVocabulary(f"{strange!r} in {phrase!r} is no colour that this model has learnt to see")
        others = tuple(w for w in before if w not in self._colours and w not in _OTHERS_BEGIN)
        return Wanted(head.kinds, self._colour(before, after), others)

    def _head(self, words: list[str]) -> _Name | None:
        """The longest name that reaches the end of the phrase's first part, among equals the last."""
        ends = next((i for i in range(1, len(words)) if self._another_begins(words, i)), len(words))
        best: _Name | None = None
        for first in range(ends):
            for last in range(min(len(words), first + self._longest), first, -1):
                kinds = self._kinds.get("".join(words[first:last]))
                if kinds is None or not all(w in _TRAILING or w in self._colours for w in words[last:ends]):
                    continue
                if best is None or last - first >= best.last - best.first:
                    best = _Name(first, last, tuple(kinds))
                break
        return best

    def _another_begins(self, words: list[str], at: int) -> bool:
        """Not after mere adjectives: "red and white umbrella", "red hanging lantern"."""
        return words[at] in _OTHERS_BEGIN and not all(w in self._colours or w in _ADJECTIVES for w in words[:at])

    def _colour(self, before: list[str], after: list[str]) -> str | None:
        """The nearest before the noun ("red and white" is red), else what the words after it say of itself."""
        for i in range(len(before) - 1, -1, -1):
            if before[i] in self._colours:
                if i >= 2 and before[i - 1] == "and" and before[i - 2] in self._colours:
                    i -= 2
                return self._colours[before[i]]
        return next((self._colours[w] for w in self._its_own(after) if w in self._colours), None)

    def _its_own(self, after: list[str]) -> list[str]:
        own = []
        for word in after:
            if word not in _STILL_ITS_COLOUR and word not in self._colours and word not in self._strange:
                break
            own.append(word)
        return own


def _words(text: str) -> list[str]:
    plain = text.lower().replace("'s", "").replace("’s", "")
    plain = re.sub(r"-?colou?red\b|\bcolou?r\b", " ", plain)
    return [_singular(w) for w in re.findall(r"[a-z0-9]+|,", plain) if w not in _ARTICLES]


def _unmeasured(words: list[str]) -> list[str]:
    """ "bunch of bananas" is bananas."""
    for i in range(len(words) - 2):
        if words[i] in _MEASURES and words[i + 1] == "of":
            return words[:i] + words[i + 2 :]
    return words


def _singular(word: str) -> str:
    if len(word) > 3 and word.endswith("s") and not word.endswith(("ss", "us")):
        return word[:-1]
    return word
