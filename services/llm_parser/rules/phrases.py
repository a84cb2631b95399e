"""Noun phrases: which runs of tokens could name a thing.

A phrase is a determiner (or none), attributes and nouns, and may go on behind "of" ("bunch of bananas"), "with" plus an
attribute of its own ("chair with red cushion") or "in a" plus a container ("cactus in a pot"). It ends at the first
word that cannot belong to a thing's name; a relative clause is never part of it.
"""

from collections.abc import Set
from dataclasses import dataclass

from services.llm_parser.rules import lexicon as lex
from services.llm_parser.rules.lexicon import words
from services.llm_parser.rules.noun_words import NounWords
from services.llm_parser.rules.tokens import Kind, Token


@dataclass(frozen=True, slots=True)
class Phrase:
    """Tokens `first` to `last` (exclusive) without the determiner; `head` is the noun that says what it is."""

    determiner: str
    lead: int
    first: int
    last: int
    head: int
    words: tuple[str, ...]

    @property
    def text(self) -> str:
        return " ".join(self.words).replace(" 's", "'s")


def find_phrases(tokens: list[Token], taken: Set[int]) -> list[Phrase]:
    """All phrases from left to right; tokens whose index is in `taken` (floor mentions) end a phrase."""
    return _Chunker(tokens, taken).all()


class _Chunker(NounWords):
    def all(self) -> list[Phrase]:
        found: list[Phrase] = []
        at = 0
        while at < self._size:
            phrase = self._phrase(at)
            if phrase is None:
                at += 1
            else:
                found.append(phrase)
                at = phrase.last
        return found

    def _phrase(self, at: int) -> Phrase | None:
        token = self._tokens[at]
        if at in self._taken or token.norm in _NEVER_FIRST or token.kind not in (Kind.WORD, Kind.CARDINAL):
            return None
        lead = at
        determiner = ""
        while at - lead < 4 and self._norm(at) in lex.DETERMINERS and self._tokens[at].is_word:
            if at > lead and self._is_sign_text(at):
                break
            determiner = self._norm(at)
            at += 1
        if determiner == "" and self._is_verb_form(at):
            return None
        if determiner in ("that", "this", "which", "what") and self._norm(at) in ("is", "'s"):
            return None
        while self._is_opinion(at) and self._belongs(at + 1, True, False):
            at += 1
            determiner = determiner or "-"
        labelled = self._is_labelled(at)
        if at == lead and not self._belongs(at, labelled, False) and not self._is_count(at):
            return None
        first = at
        if self._is_count(at):
            at += 1
        nouns_from = at
        at = self._run(at, labelled or bool(determiner) or at > first)
        if at == nouns_from or (not determiner and at == first + 1 and self._is_participle(first)):
            return None
        if all(self._norm(i) in lex.EVALUATIVE for i in range(first, at)):
            return None
        if not determiner and all(self._norm(i) in lex.ATTRIBUTES or self._norm(i) == "and" for i in range(first, at)):
            return None
        at = self._without_place(first, at)
        head = at - 1
        if self._norm(at) == "'s" and self._belongs(at + 1, True, False):
            return self._possessive(lead, first, at, determiner)
        first = self._skip_anchor(first, at, determiner)
        last = self._extend(at, head)
        return self._make(determiner, lead, first, last, head)

    def _is_opinion(self, at: int) -> bool:
        word = self._norm(at)
        superlative = word.endswith("est") and len(word) > 5 and word not in ("forest", "harvest", "tempest")
        return word in lex.EVALUATIVE or superlative

    def _is_verb_form(self, at: int) -> bool:
        """ "we are painting": no thing."""
        return self._norm(at).endswith(("ing", "ed")) and self._norm(at - 1) in (
            "is",
            "are",
            "am",
            "was",
            "were",
            "be",
            "been",
        )

    def _is_participle(self, at: int) -> bool:
        word = self._norm(at)
        return (word.endswith("ing") and word not in lex.ING_NOUNS) or (
            word.endswith("ed") and word not in lex.ED_WORDS
        )

    def _is_labelled(self, at: int) -> bool:
        """Behind a label ("Mark: hand saw") a word that is noun or verb is a noun if it goes on like one."""
        if not self._is_plain(at + 1):
            return False
        if at > 0 and self._tokens[at - 1].norm in (":", "="):
            return True
        if self._norm(at + 1) == "sign" and self._is_break(at - 1):
            return True
        return (
            self._is_break(at - 1)
            and self._is_break(at + 2)
            and (self._norm(at) not in _COMMANDS or self._norm(at + 1) in words("sign hat"))
        )

    def _is_break(self, at: int) -> bool:
        return not 0 <= at < self._size or at in self._taken or self._is_sign(at)

    def _is_sign(self, at: int) -> bool:
        token = self._tokens[at]
        picture = token.kind is Kind.CODE and not any(c.isalnum() for c in token.raw)
        return picture or token.kind in (Kind.SYMBOL, Kind.STOP)

    def _make(self, determiner: str, lead: int, first: int, last: int, head: int) -> Phrase:
        words = tuple(self._tokens[i].raw.lower() if self._tokens[i].raw else self._norm(i) for i in range(first, last))
        words = tuple("'s" if self._norm(i) == "'s" else w for i, w in zip(range(first, last), words, strict=True))
        words = tuple(
            w.removesuffix("'s") if i + 1 < len(words) and words[i + 1] == "'s" else w for i, w in enumerate(words)
        )
        return Phrase(determiner, lead, first, last, head, words)

    def _possessive(self, lead: int, first: int, at: int, determiner: str) -> Phrase | None:
        """ "a child's bicycle" is one thing; "Doris's bicycle" and "my neighbour's bicycle" are somebody's bicycle."""
        owner = self._norm(at - 1)
        end = self._run(at + 1, True)
        if end == at + 1:
            return None
        named = determiner in lex.ARTICLES and owner not in lex.PEOPLE and owner not in lex.KIN
        generic = named or (owner in lex.GENERIC_OWNERS and at - 1 == first)
        start = first if generic else at + 1
        head = end - 1
        return self._make((determiner if generic else "'s"), lead, start, self._extend(end, head), head)

    def _is_count(self, at: int) -> bool:
        token = self._tokens[at] if at < self._size and at not in self._taken else None
        if token is None or token.kind is not Kind.CARDINAL or not 2 <= token.value <= 12 or token.raw.isdigit():
            return False
        end = self._run(at + 1, True)
        head = self._norm(end - 1)
        return end > at + 1 and head.endswith("s") and head not in lex.NON_OBJECTS

    def _run(self, at: int, open_before: bool) -> int:
        """The end of the attributes and nouns that begin at `at`."""
        start = at
        has_noun = False
        while at < self._size and at - start < 8:
            if self._belongs(at, open_before or at > start, has_noun):
                has_noun = has_noun or self._norm(at) not in lex.ATTRIBUTES
                at += 1
                persons = self._norm(at - 1) in lex.KIN and self._norm(at) not in lex.OBJECT_NOUNS
                if persons and self._norm(at - 1) not in ("baby", "kid", "child", "nurse"):
                    break
            elif (
                at > start
                and self._norm(at) in ("and", ",")
                and not has_noun
                and self._norm(at + 1) in lex.ATTRIBUTES
                and (self._norm(at) == "and" or self._norm(at - 1) in lex.ATTRIBUTES)
                and self._belongs(at + 2, True, False)
            ):
                at += 2
            else:
                break
        return at

    def _skip_anchor(self, first: int, end: int, determiner: str) -> int:
        """In "window red kite" without any article, the place is no part of the thing."""
        if determiner or end - first <= 1:
            return first
        if self._norm(first) in lex.ANCHORS and self._norm(first + 1) in lex.ATTRIBUTES:
            return first + 1
        if self._norm(first) in _MARKS and self._is_break(first - 1):
            return first + 1  # "Marker blue vase."
        return first

    def _without_place(self, first: int, end: int) -> int:
        """ "large clay pot window": the place behind is no part of the thing; "kitchen window" is no thing."""
        last = self._norm(end - 2)
        named = end - first > 2 or last in lex.OBJECT_NOUNS
        if self._norm(end - 1) not in _WINDOWS or end - first < 2 or not named:
            return end
        return end if last in lex.NON_OBJECTS | lex.ATTRIBUTES else end - 1

    def _extend(self, at: int, head: int) -> int:
        noun = self._norm(head)
        for _ in range(3):
            link = self._norm(at)
            if link == "of" and (noun in lex.MEASURE_NOUNS or noun not in lex.NON_OBJECTS):
                end = self._complement(at + 1, ("a", "an", "the", "some", "two", "three"))
            elif noun in lex.NON_OBJECTS and noun not in lex.MEASURE_NOUNS:
                return at
            elif link == "with":
                end = self._complement(at + 1, ("a", "an", "two", "three"))
            elif link == "in" and self._norm(at + 1) in ("a", "an"):
                end = self._complement(at + 1, ("a", "an"))
                end = end if self._norm(end - 1) in lex.CONTAINERS else at
            elif link == "and":
                end = self._complement(at + 1, ())
                end = end if end - at <= 3 and self._norm(end - 1) not in lex.KIN else at
            else:
                return at
            barred = _PLACES_AND_PEOPLE if link == "of" else lex.NON_OBJECTS - lex.SOFT_NOUNS
            if link == "of" and noun in lex.DEPICTIONS:
                barred = words("mine ours")  # anything may be painted, a lady or a house too
            if end <= at + 1 or self._norm(end - 1) in barred:
                return at
            at = end
        return at

    def _complement(self, at: int, determiners: tuple[str, ...]) -> int:
        start = at
        if self._norm(at) in determiners:
            at += 1
        end = self._run(at, at > start)
        return end if end > at else start - 1


_PLACES_AND_PEOPLE = (
    lex.PEOPLE | lex.ANCHORS | lex.FLOOR_NOUNS | words("building block tower house street side floor mine ours room")
)

_COMMANDS = words("drop ring press hold stop skip watch catch top pass past can")
_NEVER_FIRST = frozenset(
    word
    for word in lex.CLOSED - lex.DETERMINERS - lex.EVALUATIVE - lex.NOUN_OR_VERB
    if not word.endswith(("ing", "ed"))
)

_WINDOWS = words("window balcony sill windowsill ledge")
_MARKS = words("marker mark landmark identifier beacon")
