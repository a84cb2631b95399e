"""Whose is it, is it meant, and is it still so: the context of a mention."""

from enum import Enum

from services.llm_parser.rules import lexicon as lex
from services.llm_parser.rules.lexicon import words
from services.llm_parser.rules.tokens import Kind, Token

REACH = 25


class Owner(Enum):
    MINE = "mine"
    OTHER = "other"
    UNSAID = "unsaid"


_HAS = words("has have had got gets 's owns owned keeps put puts lives live lived is are was were with who on in")
_PRONOUN_HAS = words("has have had got owns keeps put puts lives live hung")
_RESET = words("you look find spot drone")
_OTHER_WORDS = words("else else's hers theirs")
_SOMEBODY = words("someone somebody anyone everyone everybody others")
_PLAIN_HOSTS = lex.NON_OBJECTS | lex.CLOSED


def owner_before(tokens: list[Token], at: int, floor: int = 0) -> Owner:
    """The nearest word before token `at`, in its sentence and not before token `floor`, that says whose it is."""
    sentence = tokens[at].sentence if at < len(tokens) else -1
    for back in range(at - 1, max(floor, at - REACH) - 1, -1):
        token = tokens[back]
        if token.sentence != sentence or token.kind is Kind.STOP:
            break
        if not token.is_word:
            continue
        word = token.norm
        following = tokens[back + 1].norm if back + 1 < len(tokens) else ""
        if word in lex.MY:
            if word in ("me", "i") and back and tokens[back - 1].norm in ("tell", "tells", "told", "ask", "asked"):
                continue
            return Owner.MINE
        if word in lex.PEOPLE or word in _OTHER_WORDS:
            return Owner.OTHER
        if word in lex.KIN and back + 1 < at and (following in _HAS or following in ("'s",)):
            if not (back and tokens[back - 1].norm == "the" and back > 1 and tokens[back - 2].norm == "am"):
                return Owner.OTHER
        if word in ("he", "she", "they") and following in _PRONOUN_HAS:
            return Owner.OTHER
        if word in ("his", "her", "their"):
            return Owner.OTHER
        if word in _SOMEBODY and (following in _PRONOUN_HAS or following in ("else", "'s", "with")):
            return Owner.OTHER
        if word == "door" and back and tokens[back - 1].norm == "next":
            return Owner.OTHER
        if (
            word in ("upstairs", "downstairs")
            and back
            and tokens[back - 1].norm not in ("i", "am", "go", "come", "is", "'s")
        ):
            return Owner.OTHER
        if word in _RESET:
            return Owner.UNSAID
        if word == "it" and following in ("is", "'s"):
            return Owner.UNSAID
        if following in ("has", "have", "'s", "owns", "keeps") and back + 1 < at and word not in _PLAIN_HOSTS:
            if word not in lex.OBJECT_NOUNS and word not in lex.ATTRIBUTES and following != "'s":
                return Owner.OTHER
    return Owner.UNSAID


_AVOID = words(
    "ignore ignoring disregard avoid avoiding skip beware forget unlike except neither nor never without wrong"
)
_DONT_VERBS = words(
    "go come stop deliver leave confuse mistake mix fall follow trust bother fooled fool look ring knock send bring "
    "drop fly take put land try approach confused mixed want use choose pick mistaken mind give listen distracted "
    "tricked"
)
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
        if word == "but":
            return False
        if word in ("not", "isn't", "don't", "no") and direct:
            return word != "no" or tokens[at - 1].norm == "no"
        if word in ("not", "don't", "never") and not direct:
            between = {tokens[i].norm for i in range(back + 1, at)}
            if between & _DONT_VERBS and not between & {"miss", "forget", "hesitate"}:
                return True
            return False
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
        if word in ("i", "we", "you") and not direct:
            return False
    return False


_PAST_WORDS = words(
    "was were former formerly previous previously old originally earlier before used once had until lived moved "
    "relocated last wrote typed put swapped replaced exchanged switched stolen vacated written entered said"
)
_NOW_WORDS = words("now currently today nowadays is are am")


def past(tokens: list[Token], at: int, floor: int = 0) -> bool:
    """Does the clause before token `at` speak of what was: "moved from ...", "it used to be ...", "former ..."?"""
    sentence = tokens[at].sentence
    for back in range(at - 1, max(floor, at - 12) - 1, -1):
        token = tokens[back]
        if token.sentence != sentence or token.kind is Kind.STOP:
            return False
        word = token.norm
        if word in (",", ";", "but", "now") or (word in ("to", "into") and _follows_from(tokens, back, sentence)):
            return False
        if word == "old":
            return back + 1 < len(tokens) and tokens[back + 1].norm in (_OLD_PLACES)
        if word == "put" or word == "said":
            return any(t.norm in ("form", "order", "yesterday", "wrongly") for t in tokens[back : at + 8])
        if word == "last":
            return tokens[back + 1].norm in ("time", "week", "month", "year")
        if word == "before":
            return (
                back == 0
                or tokens[back - 1].kind is not Kind.WORD
                or tokens[back + 1].norm in ("i", "we", "it", "this")
            )
        if word == "had" and back and tokens[back - 1].norm in lex.MY | {"'s"} and tokens[back - 1].norm == "'s":
            return False
        if word == "used":
            return back + 1 < len(tokens) and tokens[back + 1].norm == "to"
        if word in _PAST_WORDS:
            return True
        if word in _NOW_WORDS:
            return False
    return False


_OLD_PLACES = lex.DWELLINGS | lex.FLOOR_NOUNS | lex.ANCHORS | words("address one floor")


def _follows_from(tokens: list[Token], at: int, sentence: int) -> bool:
    return any(
        t.norm in ("from", "moved", "relocated", "swapped", "changed", "switched", "not")
        for t in tokens[max(0, at - 8) : at]
        if t.sentence == sentence
    )


_DENIALS = (
    "not mine",
    "not ours",
    "not us",
    "not me",
    "not my",
    "not our",
    "not it",
    "the wrong",
    "wrong one",
    "wrong window",
    "too far",
    "next door",
    "someone else",
    "somebody else",
    "other family",
    "is theirs",
    "is hers",
    "is his",
    "not affiliated",
    "not for me",
    "gone too",
    "keep going",
    "turn around",
    "turn back",
    "not the one",
    "another flat",
    "another apartment",
    "another family",
    "different flat",
    "different apartment",
    "different window",
    "other people",
    "is a decoy",
    "is gone",
    "blew away",
    "fly on",
    "move on",
    "carry on",
    "anymore",
    "any more",
    "no longer",
    "not more",
    "out of habit",
    "last time",
    "is not where",
    "not that",
    "was stolen",
    "got stolen",
    "ignore it",
    "ignore that",
    "skip it",
    "that was before",
    "was wrong",
    "is wrong",
    "by mistake",
    "that is them",
    "belongs to my",
    "belongs to the",
    "belongs to a ",
    "not where",
    "is the neighbour",
    "is my neighbour",
    "is our neighbour",
    "is a neighbour",
    "that is the guy",
    "that is the lady",
    "that is the other",
    "is the other",
    "used to be",
)
_CONFIRMATIONS = (
    "that is us",
    "that is me",
    "that is mine",
    "that is ours",
    "that is my",
    "that is our",
    "is mine",
    "is ours",
    "= mine",
    "= me",
    "= us",
    "= my",
    "is my window",
    "is our window",
    "marks",
    "is me",
    "is us",
    "is my landmark",
    "is right",
    "will be me",
    "gives me away",
    "that one is mine",
)


def after(tokens: list[Token], at: int, limit: int) -> str:
    """The words from token `at` on, up to `limit` (exclusive) or 9 words, as one text for a look at fixed phrases."""
    words: list[str] = []
    for token in tokens[at : min(limit, at + 10)]:
        if token.kind is Kind.STOP:
            words.append("|")
            continue
        if token.kind is not Kind.SYMBOL or token.norm == "=":
            words.append(token.norm)
    return " " + " ".join(words).replace(" 's", " is") + " "


def denied_after(text: str) -> bool:
    """Is what stood before `text` taken back by it: "... that's the wrong one", "... but not any more"?"""
    own = text.split(" my ")[0] if " not my " not in text else text
    if "|" in own:
        first, second = own.split("|", 1)
        own = first + ("|" + second.split("|")[0] if second.startswith((" that is", " it is not", " not")) else "")
    return any(_has(own, phrase) for phrase in _DENIALS)


def confirmed_after(text: str) -> bool:
    """Is what stood before `text` claimed by it: "... is mine", "... that's us"?"""
    return any(_has(text, phrase) for phrase in _CONFIRMATIONS) and "not m" not in text and "not o" not in text


def _has(text: str, phrase: str) -> bool:
    return f" {phrase.strip()} " in text
