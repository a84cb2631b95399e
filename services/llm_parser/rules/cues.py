"""What a phrase's own words, and its standing as a clause, say about its being the mark at the customer's window.

All figures are points on one scale: about 5 for a plain statement ("my window has a ..."), 3 for a hint ("next to the
..."), 1 or less for what only breaks ties (a colour).
"""

from collections.abc import Set

from services.llm_parser.rules import lexicon as lex
from services.llm_parser.rules.lexicon import words
from services.llm_parser.rules.phrases import Phrase
from services.llm_parser.rules.tokens import Kind, Token

_BREAKS = (Kind.STOP, Kind.SYMBOL)


def own_worth(tokens: list[Token], phrase: Phrase) -> float:
    """What the phrase's own words say: what cameras see counts, goods and abstractions count against it."""
    own = {tokens[i].norm for i in range(phrase.first, phrase.last)}
    head = tokens[phrase.head].norm
    known = head in lex.OBJECT_NOUNS or head.rstrip("s") in lex.OBJECT_NOUNS
    worth = 0.75 * known
    if own & lex.COLOURS:
        worth += 1.0
    elif own & lex.ATTRIBUTES:
        worth += 0.5
    if own <= lex.ATTRIBUTES - lex.OBJECT_NOUNS - _NOUNS_TOO:
        worth -= 3.0
    if head in lex.PARCEL_NOUNS:
        worth -= 4.0 if len(own) == 1 else 0.5
    if head in lex.SOFT_NOUNS and phrase.last == phrase.head + 1:
        worth -= 0.25
    proper = tokens[phrase.head].raw[:1].isupper() and not tokens[phrase.head].raw.isupper()
    inside = bool(phrase.lead) and tokens[phrase.lead - 1].is_word
    if len(own) == 1 and not phrase.determiner and inside and not known:
        worth -= 1.5 if proper else 0.75
    if _addressed(tokens, phrase):
        worth -= 4.0
    if phrase.determiner in ("no", "any", "every", "each"):
        worth -= 2.0
    if head.endswith(("ness", "tion", "ment", "ity", "ism")) and head not in _SOLID_IN_SPITE:
        worth -= 2.0
    return worth


_NOUNS_TOO = words("toy antique glass miniature plush square gold silver light marble paper leather straw bamboo")
_SOLID_IN_SPITE = words("ornament instrument monument carnation harness")


_FAREWELLS = words("regards sincerely faithfully wishes yours cheers love")


def _addressed(tokens: list[Token], phrase: Phrase) -> bool:
    """ "Dear flying toaster, ...", "... you glorious machine." """
    said = tokens[phrase.lead].norm if phrase.determiner == "-" else ""
    called = said == "dear" or (phrase.lead > 0 and tokens[phrase.lead - 1].norm in ("dear", "you", "hello", "fellow"))
    if phrase.lead > 1 and tokens[phrase.lead - 1].norm == "," and tokens[phrase.lead - 2].norm in _FAREWELLS:
        return True
    ends = phrase.last >= len(tokens) or tokens[phrase.last].kind in _BREAKS
    return called and ends and phrase.determiner in ("", "-")


def alone(tokens: list[Token], phrase: Phrase, taken: Set[int]) -> float:
    """A phrase that is a clause by itself: "The bicycle wheel." or "5th floor, bicycle wheel, thanks"."""
    front = phrase.lead - 1
    if front > 0 and tokens[front].norm in ("and", "so", "then", "plus"):
        front -= 1
    opens = front < 0 or tokens[front].kind in _BREAKS or front in taken
    substance = phrase.determiner or phrase.last - phrase.first > 1 or own_worth(tokens, phrase) > 0
    if substance and is_clause(tokens, phrase, taken):
        return 1.25
    return 0.75 if opens and phrase.determiner in ("a", "an") else 0.0


def is_clause(tokens: list[Token], phrase: Phrase, taken: Set[int]) -> bool:
    """Do breaks or floors stand on both sides of the phrase? A joining "and" in front is passed over."""
    front, end = phrase.lead - 1, phrase.last
    if front > 0 and tokens[front].norm in ("and", "so", "then", "plus"):
        front -= 1
    opens = front < 0 or tokens[front].kind in _BREAKS or front in taken
    if end < len(tokens) and tokens[end].norm in ("at", "on", "in"):
        end += 1 + (tokens[end + 1].norm == "the" if end + 1 < len(tokens) else 0)
        return opens and end in taken
    return opens and (end >= len(tokens) or tokens[end].kind in _BREAKS or end in taken)
