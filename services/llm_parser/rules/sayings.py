"""Fixed phrases behind a mention that take it back ("... that's the wrong one") or claim it ("... that's us")."""

import re

from services.llm_parser.rules.lexicon import words
from services.llm_parser.rules.tokens import Kind, Token

_DENIALS = (
    "is inside",
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
    "not where",
    "is the neighbour",
    "is my neighbour",
    "is our neighbour",
    "is a neighbour",
    "that is the guy",
    "that is the lady",
    "that is the other",
    "is the other",
    "stay away",
    "outdated",
    "out of date",
    "incorrect",
    "not true",
    "not right",
    "not correct",
    "is old",
    "not try there",
    "not of",
    "used to be",
    "fell and",
    "fell off",
    "fell down",
    "flew away",
    "got lost",
    "and broke",
    "been removed",
    "was removed",
    "been replaced",
    "was replaced",
    "been taken",
    "was taken",
    "previously used",
    "formerly used",
    "with her which",
    "with him which",
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
    "you have reached",
    "you have found",
    "you are at my",
    "you are at our",
    "right place",
    "right window",
    "will be me",
    "gives me away",
    "that one is mine",
)


def _any_of(phrases: tuple[str, ...]) -> re.Pattern[str]:
    return re.compile("(?<= )(?:" + "|".join(re.escape(phrase.strip()) for phrase in phrases) + ")(?= )")


_DENIAL = _any_of(_DENIALS)
_BELONGS_ELSEWHERE = re.compile(r" belongs? to (?!me |us |my (?!neighbour)|our (?!neighbour))| = not ")
_CONFIRMATION = _any_of(_CONFIRMATIONS)
_OLD_ONE = re.compile(
    r"(?: wait| no| sorry| oops)* (?:that|it|this) (?:is|was) (?:my|our|the) (?:old|former|previous) "
)
_GOES_ON = words("belongs belonged you then that which it but not no and so is was = he she they - (")


def after(tokens: list[Token], at: int, limit: int) -> str:
    """The words from token `at` on, up to `limit` (exclusive), 10 words or a clause about something else, as one text
    for a look at fixed phrases; "|" is the end of a sentence."""
    said: list[str] = []
    for index in range(at, min(limit, at + 15, len(tokens))):
        token = tokens[index]
        if token.kind is Kind.STOP:
            said.append("|")
        elif token.kind is Kind.SYMBOL and token.norm != "=":
            following = tokens[index + 1].norm if index + 1 < len(tokens) else ""
            if following not in _GOES_ON:
                break
        else:
            said.append(token.norm)
    return " " + " ".join(said).replace(" 's", " is") + " "


# "my ..." opens a matter of the customer's own, but "is my neighbour's" and "belongs to my ..." go on about the thing
_ANOTHER_MATTER = re.compile(r"(?<! belongs to) my (?!neighbour )")


def denied_after(text: str) -> bool:
    """Is what stood before `text` taken back by it: "... that's the wrong one", "... but not any more"?"""
    own = _ANOTHER_MATTER.split(text)[0] if " not my " not in text else text
    if "|" in own:
        first, second = own.split("|", 1)
        goes_on = not second.startswith(" not the one with") and second.startswith(
            (" that is", " no ", " it is not", " not", " stay away")
        )
        own = first + (second.split("|")[0] if goes_on else "")
    if _OLD_ONE.match(text) is not None:
        return True
    return _DENIAL.search(own) is not None or _BELONGS_ELSEWHERE.search(own) is not None


def confirmed_after(text: str) -> bool:
    """Is what stood before `text` claimed by it: "... is mine", "... that's us"?"""
    return _CONFIRMATION.search(text) is not None and "not m" not in text and "not o" not in text
