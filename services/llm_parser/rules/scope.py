"""Whose is it, is it meant, and is it still so: the context of a mention."""

from collections.abc import Sequence
from enum import Enum
from typing import NamedTuple, TypeVar

from services.llm_parser.rules import lexicon as lex
from services.llm_parser.rules.lexicon import words
from services.llm_parser.rules.tokens import Kind, Token

REACH = 25
T = TypeVar("T")


class Owner(Enum):
    MINE = "mine"
    UNSAID = "unsaid"
    SOMEONE = "someone"
    """A third person who may well be the customer's own household: "dad put ...", "she lives on ..."."""
    NEIGHBOUR = "neighbour"
    """Surely not the customer."""


_KIN_HAS = words("has have had got 's owns owned keeps lives live lived is are was were with who on in")
_PRONOUN_HAS = words("has have had got owns keeps put puts lives live hung")
_RESET = words("you look find spot drone come go deliver bring send fly please straight")
_SOMEBODY = words("someone somebody anyone everyone everybody nobody others")
_PLAIN_HOSTS = lex.NON_OBJECTS | lex.CLOSED | lex.OBJECT_NOUNS | lex.ATTRIBUTES


def owner_before(tokens: list[Token], at: int, floor: int = 0) -> Owner:
    """The nearest word before token `at`, in its sentence and not before token `floor`, that says whose it is."""
    sentence = tokens[at].sentence if at < len(tokens) else -1
    for back in range(at - 1, max(floor, at - REACH) - 1, -1):
        token = tokens[back]
        if token.sentence != sentence or token.kind is Kind.STOP:
            break
        if token.is_word:
            owner = _owner_word(tokens, back, at)
            if owner is Owner.SOMEONE and token.norm in _THIRD and _names_people(tokens, back):
                return Owner.NEIGHBOUR
            if owner is not None:
                return owner
    return Owner.UNSAID


_THIRD = words("he she they his her their")


def _names_people(tokens: list[Token], at: int) -> bool:
    """Does a pronoun at `at` follow a neighbour whom it may stand for?"""
    return any(t.norm in lex.PEOPLE for t in tokens[max(0, at - 12) : at])


_OTHER_ONE = words("one window has have is flat balcony with apartment sill")


def _mine_said(tokens: list[Token], at: int) -> bool:
    """Was the customer's own named before "the other one" in the same sentence?"""
    sentence = tokens[at].sentence
    return any(t.norm in ("mine", "ours", "my", "our") and t.sentence == sentence for t in tokens[max(0, at - 14) : at])


_MARKED = words("with who whose on behind at")


_PERFECT = words("not never seen been always")


def _owner_word(tokens: list[Token], at: int, mention: int) -> Owner | None:
    """What the word at `at` says about the owner of what is mentioned at `mention`."""
    word = tokens[at].norm
    before = tokens[at - 1].norm if at else ""
    earlier = tokens[at - 2].norm if at > 1 else ""
    following = tokens[at + 1].norm if at + 1 < len(tokens) else ""
    if word in lex.MY:
        return Owner.UNSAID if word == "me" and before in ("tell", "tells", "told", "ask", "asked") else Owner.MINE
    if word == "other" and following in _OTHER_ONE and _mine_said(tokens, at):
        return Owner.NEIGHBOUR
    if word in ("else", "else's") and before in _SOMEBODY:
        return Owner.NEIGHBOUR
    if word in lex.PEOPLE and _is_figure(tokens, at):
        return None
    if word in lex.PEOPLE and (before in ("are", "am") or {before, earlier} in ({"a", "are"}, {"a", "am"})):
        return Owner.MINE  # "we are a family with ..."
    if word in ("mr", "mrs", "ms", "miss", "dr") and before in ("is", "am"):
        return Owner.UNSAID  # "this is Mrs Jones from the ..."
    if word in lex.PEOPLE and before == "the" and at > 1 and tokens[at - 2].norm == "for" and following in _MARKED:
        return Owner.UNSAID  # "it is for the person with the ..."
    if word in lex.PEOPLE or word in ("hers", "theirs") or (word == "door" and before == "next"):
        return Owner.NEIGHBOUR
    if word in _RESET or (word == "it" and following in ("is", "'s")):
        return Owner.UNSAID
    if word in lex.KIN and at + 1 < mention and following in _KIN_HAS and before != "the":
        return Owner.SOMEONE
    if following in ("had", "have", "has") and at + 2 < len(tokens) and tokens[at + 2].norm in _PERFECT:
        return None  # "they had not seen ..." owns nothing
    got = following in ("is", "'s") and at + 2 < len(tokens) and tokens[at + 2].norm == "got"
    if (word in ("he", "she", "they") and (got or following in _PRONOUN_HAS)) or word in ("his", "her", "their"):
        return Owner.SOMEONE
    if word in _SOMEBODY and (following in _PRONOUN_HAS or following in ("else", "'s", "with", "on", "in")):
        return Owner.NEIGHBOUR if following in ("else", "with") else Owner.SOMEONE
    if word in ("upstairs", "downstairs") and before in ("from", "family", "people", "one", "guys", "lot"):
        return Owner.NEIGHBOUR
    owns = following in ("has", "have", "owns", "keeps") and at + 1 < mention
    if owns and word not in _PLAIN_HOSTS and (at + 2 >= len(tokens) or tokens[at + 2].norm != "it"):
        return Owner.SOMEONE
    return None


def _is_figure(tokens: list[Token], at: int) -> bool:
    """ "a snow man", "the portrait of a lady": no person."""
    before = [t.norm for t in tokens[max(0, at - 4) : at]]
    painted = len(before) >= 2 and any(
        before[k] in lex.DEPICTIONS and before[k + 1] == "of" for k in range(len(before) - 1)
    )
    return painted or (bool(before) and before[-1] in lex.FIGURE_STUFF)


_AVOID = words(
    "ignore ignoring disregard avoid avoiding skip beware forget unlike except neither nor never without wrong"
)
_DONT_VERBS = words(
    "go come stop deliver leave confuse mistake mix fall follow trust bother fooled fool look ring knock send bring "
    "drop fly take put land try approach confused mixed want use choose pick mistaken mind give listen distracted "
    "tricked"
)
_NOT_BUT = words("every everyone everybody many only just")
_NOT_BRIDGE = (
    lex.ARTICLES
    | lex.ANCHORS
    | lex.FLOOR_NOUNS
    | words(
        "to at on in by with near for my our his her their that one from number is it of next beside be the window "
        "has behind under above"
    )
)


def negated(tokens: list[Token], at: int, floor: int = 0) -> bool:
    """Does the clause before token `at` deny it: "not the ...", "don't go to ...", "ignore ...", "instead of ..."?"""
    sentence = tokens[at].sentence
    direct = True
    for back in range(at - 1, max(floor, at - 14) - 1, -1):
        token = tokens[back]
        if token.sentence != sentence or token.kind is Kind.STOP:
            return False
        word = token.norm
        if token.kind is Kind.SYMBOL:
            if word in (",", ";", "-", ":", "(", ")"):
                return False
            continue
        following = tokens[back + 1].norm
        if word == "but" or (word in ("it", "that") and following in ("is", "'s") and back + 2 <= at):
            return False
        if word in ("not", "never") and (
            following in _NOT_BUT or (following == "seen" and tokens[back - 1].norm in ("had", "have"))
        ):
            return False
        if word in ("not", "isn't", "don't", "no") and direct:
            return word != "no" or tokens[at - 1].norm == "no"
        if word in ("not", "don't", "never") and not direct:
            between = {tokens[i].norm for i in range(back + 1, at)}
            if tokens[back + 1].norm == "be" and between & {"by", "with", "into"}:
                return True
            return bool(between & _DONT_VERBS and not between & {"miss", "forget", "hesitate"})
        if word in _AVOID and word != "forget":
            return True
        if word == "forget" and not (back and tokens[back - 1].norm in ("not", "n't")):
            return True
        if word == "of" and back and tokens[back - 1].norm == "instead":
            return True
        if word == "than" and back and tokens[back - 1].norm == "rather":
            return True
        if word == "from" and back > 1 and tokens[back - 1].norm == "away":
            return True
        if word in ("past", "beyond") and back and tokens[back - 1].norm in ("fly", "go", "continue"):
            return True
        if direct and word not in _NOT_BRIDGE:
            direct = False
        if word in ("i", "we", "you", "mine", "ours") and not direct:
            return False
    return False


_PAST_WORDS = words(
    "was were former formerly previous previously originally earlier once had until lived moved relocated wrote "
    "typed replaced exchanged switched swapped vacated entered removed sold threw lost"
)
_ONCE_STATED = words("former formerly previous previously originally")
_NOW_WORDS = words("now currently today nowadays is are am but however")


def past(tokens: list[Token], at: int, was_within: int = 3) -> bool:
    """Does the clause before token `at` speak of what was: "moved from ...", "it used to be ...", "former ..."?

    "was" counts only among the last `was_within` words."""
    sentence = tokens[at].sentence
    depth = 0
    same_clause = True
    for back in range(at - 1, max(0, at - 36) - 1, -1):
        token = tokens[back]
        word = token.norm
        if token.sentence != sentence or token.kind is Kind.STOP:
            return False
        depth += (word == ")") - (word == "(")
        if depth > 0:
            continue
        following = tokens[back + 1].norm
        if word == "used" and following == "to":
            return True
        if word in _NOW_WORDS or (
            word in ("to", "for", "by", "with", "into") and _follows_from(tokens, back, sentence)
        ):
            return False
        same_clause = same_clause and word not in (",", ";") and at - back <= 12
        if not same_clause:
            continue
        if word == "old" and following in _OLD_PLACES:
            return True
        if word in ("put", "said", "gave", "says") and _is_form(tokens, back, at):
            return True
        if word == "last" and was_within > 1 and following in ("time", "week", "month", "year"):
            return True
        if word == "before" and (back == 0 or not tokens[back - 1].is_word or following in ("i", "we", "it", "this")):
            return True
        if word in ("was", "were", "had") and at - back > was_within:
            continue
        if word == "had" and back and tokens[back - 1].norm == "have":
            return False
        if word == "moved" and not any(t.norm in ("from", "out") for t in tokens[back:at]):
            continue
        if word in _PAST_WORDS and not (word == "until" and following in ("you", "your", "it", "the")):
            return True
    return False


def _is_form(tokens: list[Token], start: int, end: int) -> bool:
    """Is it what a form says that was filled in wrongly?"""
    return any(
        t.norm in ("form", "order", "yesterday", "wrongly", "label") for t in tokens[max(0, start - 3) : end + 6]
    )


_OLD_PLACES = lex.DWELLINGS | lex.FLOOR_NOUNS | lex.ANCHORS | words("address one floor")


def _follows_from(tokens: list[Token], at: int, sentence: int) -> bool:
    return any(
        t.norm in ("from", "moved", "relocated", "swapped", "replaced", "exchanged", "changed", "switched", "not")
        for t in tokens[max(0, at - 8) : at]
        if t.sentence == sentence
    )


_WHICH = {"first": 0, "former": 0, "second": 1, "latter": 1, "third": 2, "last": -1}


class Which(NamedTuple):
    """The customer's in a list of what was named: counted from 0, or -1 for the last; said at token `at`."""

    at: int
    place: int

    def of(self, named: Sequence[T]) -> T:
        return named[self.place if self.place < 0 else min(self.place, len(named) - 1)]


def mine_is_the(tokens: list[Token]) -> Which | None:
    """ "Mine is the second one"."""
    for at, token in enumerate(tokens[:-2]):
        mine = token.norm in ("mine", "ours") or (
            token.norm in ("window", "flat") and at > 0 and tokens[at - 1].norm in ("my", "our")
        )
        said = [t.norm for t in tokens[at + 1 : at + 6]]
        if mine and said[0] in ("is", "'s") and not set(said) & lex.FLOOR_NOUNS:
            for word in said[1:3]:
                if word in _WHICH:
                    return Which(at, _WHICH[word])
    return None
