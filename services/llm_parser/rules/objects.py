"""Which of the noun phrases marks the customer's window: cues before and behind each phrase, added up."""

from collections.abc import Set
from dataclasses import dataclass, replace

from services.llm_parser.rules import lexicon as lex
from services.llm_parser.rules import scope
from services.llm_parser.rules.lexicon import words
from services.llm_parser.rules.phrases import Phrase
from services.llm_parser.rules.tokens import Kind, Token

THRESHOLD = 0.7
"""A phrase for which less speaks than this is not taken: a missing object is said, not guessed."""

_LOOK = words(
    "look looking see spot find search searching recognise recognize identify notice identifiable identified marked "
    "marks marker mark landmark reference watch seek spotting finding lookout recognisable recognizable marking "
    "flagged distinguished beacon notices sees mentioned sign spots clue hint cue seeing locate locating follow "
    "visual identifier id indicator"
)
_STAND = words("is are hangs stands sits hang stand sit lies hanging standing sitting lives")
_NEAR = words(
    "near beside by behind under underneath below above opposite adjacent alongside next close besides against facing"
)
_DELIVER = words(
    "deliver bring send leave drop put take hand carry fly get need want ordered order expecting sending bringing "
    "expect leaving dropping delivering place set await awaiting handing requested give buy bought receive brought "
    "wants purchased dispatched dispatch transport shipment lower pick collect return ship pass waiting lost "
    "missing"
)
_PUT_OUT = words(
    "put placed place hung set stuck tied left keep kept have got had installed mounted taped parked propped"
)
_SELF = words("i we")
_AT = words("at by on in outside near beside behind next inside from below under above against across")
_HAVE = words(
    "has have having got with 's shows displays displaying features featuring bearing sports bears carries boasts "
    "showing holds wearing"
)
_PERSONS_DO = words(
    "put puts painted says said told tells thinks lives likes loves has bought ordered wants keeps works"
)
_BREAKS = (Kind.STOP, Kind.SYMBOL)
_PLACES = lex.ANCHORS | lex.DWELLINGS


@dataclass(frozen=True, slots=True)
class ScoredPhrase:
    """`doubt` is the part of the score that is held against a phrase for belonging to some third person."""

    phrase: Phrase
    score: float
    doubt: float = 0.0


def choose_object(tokens: list[Token], phrases: list[Phrase], taken: Set[int]) -> Phrase | None:
    """The phrase that most speaks for being the mark, or None where none does."""
    scored = score_phrases(tokens, phrases, taken)
    good = [s for s in scored if s.score >= THRESHOLD]
    if not good:
        good = [replace(s, score=s.score + s.doubt) for s in scored if s.score + s.doubt >= THRESHOLD + 1.0]
    if not good:
        return None
    best = max(good, key=lambda s: s.score).phrase
    return _fullest(tokens, best, scored)


def _fullest(tokens: list[Token], best: Phrase, scored: list[ScoredPhrase]) -> Phrase:
    """The same thing by its longer name, where the request has one: "a brass lantern ... the lantern hangs ..."."""
    same = [
        s.phrase
        for s in scored
        if s.score > -3.0
        and tokens[s.phrase.head].norm == tokens[best.head].norm
        and set(s.phrase.words) > set(best.words)
    ]
    return max(same, key=lambda p: len(p.words)) if same and best.determiner not in ("a", "an") else best


def score_phrases(tokens: list[Token], phrases: list[Phrase], taken: Set[int]) -> list[ScoredPhrase]:
    """Every phrase that names a thing, with its score."""
    things = [p for p in phrases if _names_thing(tokens, p)]
    ordinal_choice = _mine_is_the(tokens)
    scored = [_score(tokens, things, i, taken) for i in range(len(things))]
    if ordinal_choice is not None:
        marked = [i for i, s in enumerate(scored) if s.score > 2.0 or _in_one_other(tokens, s.phrase)]
        if len(marked) >= 2:
            wanted = marked[ordinal_choice if ordinal_choice < 0 else min(ordinal_choice, len(marked) - 1)]
            scored[wanted] = replace(scored[wanted], score=scored[wanted].score + 12.0)
    return scored


def _names_thing(tokens: list[Token], phrase: Phrase) -> bool:
    head = tokens[phrase.head].norm
    if head in lex.KIN or head in lex.PEOPLE:
        return False
    if head not in lex.NON_OBJECTS:
        return True
    if head in lex.SOFT_NOUNS and phrase.head > phrase.first:
        return tokens[phrase.first].norm not in lex.FLOOR_NOUNS | lex.NON_OBJECTS
    return _measures(tokens, phrase)


def _measures(tokens: list[Token], phrase: Phrase) -> bool:
    return tokens[phrase.head].norm in lex.MEASURE_NOUNS and phrase.last > phrase.head + 1


def _in_one_other(tokens: list[Token], phrase: Phrase) -> bool:
    return any(t.norm in ("one", "other", "first", "second") for t in tokens[max(0, phrase.lead - 4) : phrase.lead])


def _mine_is_the(tokens: list[Token]) -> int | None:
    """ "Mine is the second one": which of the marks in order, from 0, or -1 for the last."""
    for at, token in enumerate(tokens[:-2]):
        if token.norm in ("mine", "ours") or (
            token.norm in ("window", "flat") and tokens[at - 1].norm in ("my", "our")
        ):
            words = [t.norm for t in tokens[at + 1 : at + 6]]
            if words[:1] == ["is"] or words[:1] == ["'s"]:
                for word, index in (
                    ("first", 0),
                    ("former", 0),
                    ("second", 1),
                    ("latter", 1),
                    ("third", 2),
                    ("last", -1),
                ):
                    if word in words[1:3] and "floor" not in words:
                        return index
    return None


def _score(tokens: list[Token], things: list[Phrase], index: int, taken: Set[int]) -> ScoredPhrase:
    phrase = things[index]
    before_limit = things[index - 1].last if index else 0
    after_limit = things[index + 1].lead if index + 1 < len(things) else len(tokens)
    score = _own_worth(tokens, phrase)
    score += _cues_before(tokens, phrase, before_limit)
    score += _cues_after(tokens, phrase, after_limit)
    score += _fragment(tokens, phrase, taken)
    owner = scope.owner_before(tokens, phrase.lead, before_limit)
    if phrase.determiner in ("his", "her", "their", "'s"):
        owner = _possessor(tokens, phrase)
    doubt = 0.0
    if owner is scope.Owner.NEIGHBOUR and not _reset_by_mine(tokens, phrase):
        score -= 9.0
    elif owner is scope.Owner.SOMEONE and not _reset_by_mine(tokens, phrase):
        doubt = 7.0
    elif owner is scope.Owner.MINE:
        score += 0.5
    if scope.negated(tokens, phrase.lead, before_limit):
        score -= 10.0
    if scope.past(tokens, phrase.lead, was_within=1):
        score -= 5.0
    text = scope.after(tokens, phrase.last, after_limit)
    if scope.denied_after(text) or _not_about_mine(text):
        score -= 9.0
    elif scope.confirmed_after(text):
        score += 4.0
    if index + 1 < len(things) and _corrected_between(tokens, phrase.last, things[index + 1].lead):
        score -= 8.0
    score += 1.5 * sum(
        tokens[o.head].norm == tokens[phrase.head].norm and set(o.words) <= set(phrase.words)
        for o in things
        if o is not phrase
    )
    return ScoredPhrase(phrase, score - doubt - 0.01 * index, doubt)


def _own_worth(tokens: list[Token], phrase: Phrase) -> float:
    words = {tokens[i].norm for i in range(phrase.first, phrase.last)}
    head = tokens[phrase.head].norm
    worth = 0.0
    if words & lex.COLOURS:
        worth += 1.5
    elif words & lex.ATTRIBUTES:
        worth += 0.75
    if head in lex.OBJECT_NOUNS or head.rstrip("s") in lex.OBJECT_NOUNS:
        worth += 1.0
    if head in lex.PARCEL_NOUNS:
        worth -= 4.0
    if head in lex.SOFT_NOUNS:
        worth -= 0.5
    proper = tokens[phrase.head].raw[:1].isupper() and not tokens[phrase.head].raw.isupper()
    if len(words) == 1 and proper and not phrase.determiner and phrase.lead and tokens[phrase.lead - 1].is_word:
        worth -= 1.5
    if phrase.determiner in ("no", "any", "every", "each", "another"):
        worth -= 2.0
    if head.endswith(("ness", "tion", "ment", "ity", "ism")):
        worth -= 2.0
    return worth


def _cues_before(tokens: list[Token], phrase: Phrase, limit: int) -> float:
    start = max(limit, phrase.lead - 9)
    back: list[str] = []
    for at in range(phrase.lead - 1, start - 1, -1):
        if tokens[at].kind is Kind.STOP:
            break
        back.append(tokens[at].norm)
    if not back:
        return 0.0
    first = back[0]
    second = back[1] if len(back) > 1 else ""
    near = set(back[:4])
    score = 0.0
    if near & _LOOK and not near & {"looking"} & {"forward"}:
        score += 4.0
    if first in (":", "=", "-") and any(w in _LOOK | _PLACES for w in back[1:3]):
        score += 4.0
    if first in _HAVE or (first in ("up", "out") and second in _HAVE):
        hosts = set(back[1:5])
        score += 2.0
        if hosts & lex.ANCHORS:
            score += 3.0
        elif hosts & _PLACES:
            score += 2.5
        elif hosts & _SELF:
            score += 1.0
    if first in _STAND and second in ("there", "here", "hangs", "where"):
        score += 3.0
    elif first in _STAND and second in ("mine", "ours"):
        score += 4.0
    elif first in ("hangs", "stands", "sits", "hanging", "standing", "sitting", "hang", "stand") or (
        first == "is" and set(back[1:3]) & (_LOOK | lex.ANCHORS)
    ):
        score += 3.0
    elif first in ("is", "be", "are", "'s") and second not in ("there",):
        score -= 0.25 if second in ("it", "that", "this") else 0.5
    if first in _NEAR or (
        first in ("to", "of", "from") and second in ("next", "close", "adjacent", "front", "left", "right", "side")
    ):
        score += 3.0
        if set(back[1:6]) & lex.ANCHORS:
            score += 1.0
    if first in _PUT_OUT | {"puts", "hung", "hangs"} and set(back[1:4]) & words(
        "she he they dad mum mom mummy daddy wife husband"
    ):
        score += 2.0
    if set(back[1:7]) & lex.ANCHORS and set(back[2:8]) & {"at", "on", "by", "in"} and first not in _HAVE:
        score += 1.0
    if near & {"outside", "visible"} and first not in ("at", "on", "in"):
        score += 1.0
    if first in ("still", "mentioned"):
        score += 1.5
    if first == "where" and back[1:2] != ["is"]:
        score += 2.5
    if set(back[:3]) & (_PUT_OUT - _HAVE) and set(back[1:5]) & _SELF:
        score += 3.0
    if first in ("at", "on", "in", "to", "for", "into", "from", "about", "until") and not near & _LOOK:
        score -= 1.5 if first != "at" else 0.0
    parcelled = _delivered(back)
    return score - (5.0 if parcelled else 0.0)


def _fragment(tokens: list[Token], phrase: Phrase, taken: Set[int]) -> float:
    """A phrase that is a clause by itself: "The bicycle wheel." or "5th floor, bicycle wheel, thanks"."""
    before, behind = phrase.lead - 1, phrase.last
    opens = before < 0 or tokens[before].kind in _BREAKS or before in taken
    closes = behind >= len(tokens) or tokens[behind].kind in _BREAKS or behind in taken
    substance = phrase.determiner or phrase.last - phrase.first > 1 or _own_worth(tokens, phrase) > 0
    return 1.25 if opens and closes and substance else 0.0


def _delivered(back: list[str]) -> bool:
    """Is the phrase what is to be brought: the direct object of "bring", "leave", "waiting for" and the like?"""
    labels = ("item", "items", "parcel", "order", "contents", "package", "goods", "delivery", "ordered")
    if back[0] in (":", "=", "-") and len(back) > 1 and back[1] in labels:
        return True
    for depth, word in enumerate(back[:5]):
        if word in _DELIVER:
            subject = back[depth + 1 : depth + 3]
            if word in _BOTH_WAYS and subject and subject[0] not in _COMMANDING:
                return False
            if word in ("put", "placed", "place", "left", "set") and set(subject) & (_SELF | {"have"}):
                return False
            return True
        if word in ("for", "on") and depth == 0 and len(back) > 1 and back[1] in ("waiting", "wait"):
            return True
        if (
            word in ("of", "with")
            and depth == 0
            and len(back) > 1
            and back[1] in ("shipment", "care", "delivery", "careful")
        ):
            return True
        if word == "with" and depth == 0 and set(back[1:4]) & {"careful", "gentle", "care"}:
            return True
        if word not in (
            "me",
            "us",
            "up",
            "off",
            "over",
            "to",
            "for",
            "please",
            "just",
            "you",
            "kindly",
            "out",
            "the",
            "my",
        ):
            return False
        if word in ("for", "to", "out") and depth == 0:
            return False
    return False


def _cues_after(tokens: list[Token], phrase: Phrase, limit: int) -> float:
    ahead: list[str] = []
    for at in range(phrase.last, min(limit, phrase.last + 7, len(tokens))):
        if tokens[at].kind is Kind.STOP:
            break
        ahead.append(tokens[at].norm)
    if ahead[:1] == [","]:
        del ahead[0]
    if not ahead:
        return _said_after_it(tokens, phrase)
    first = ahead[0]
    near = set(ahead[:6])
    score = _said_after_it(tokens, phrase)
    if first in ("that", "which") and len(ahead) > 2 and ahead[1] not in ("i", "you", "he", "she", "they"):
        if near & lex.ANCHORS or near & {"outside", "hangs", "stands", "sits"}:
            score += 2.0
    if first in _AT or (
        first in ("hanging", "standing", "sitting", "right", "displayed", "placed", "just", "there", "leaning")
    ):
        if near & lex.ANCHORS:
            score += 3.5
        elif first == "outside":
            score += 2.5
        elif near & _PLACES:
            score += 1.0
    elif near & lex.ANCHORS and first in ("is", "that", "which", "in", ",", "="):
        score += 1.5
    if first in _PERSONS_DO:
        score -= 2.0
    if first in ("marks", "hangs", "stands", "sits", "shows", "="):
        score += 2.5
    if first == "hanging" or first == "standing":
        score += 1.0
    if (
        first in ("is", "are")
        and len(ahead) > 1
        and ahead[1] in ("still", "at", "by", "outside", "in", "on", "hanging", "visible", "mine", "my")
    ):
        score += 2.0
    if first == "is" and len(ahead) > 2 and ahead[1] == "for":
        score -= 3.0
    return score


_BOTH_WAYS = words("put puts placed place set left")
_COMMANDING = words("please and you to kindly just or then , be it")


def _said_after_it(tokens: list[Token], phrase: Phrase) -> float:
    """ "... a cactus! It's sitting in my window": the next sentence places the thing at the window."""
    at = phrase.last
    while at < len(tokens) and tokens[at].kind is not Kind.STOP:
        at += 1
    if at - phrase.last > 12:
        return 0.0
    rest = [t.norm for t in tokens[at + 1 : at + 14] if t.sentence == tokens[phrase.last - 1].sentence + 1]
    if rest[:1] == ["it"] and set(rest) & lex.ANCHORS and set(rest) & lex.MY:
        return 4.0
    return 0.0


def _possessor(tokens: list[Token], phrase: Phrase) -> scope.Owner:
    if phrase.determiner != "'s":
        return scope.Owner.SOMEONE
    words = [tokens[i].norm for i in range(phrase.lead, phrase.first)]
    if set(words) & lex.PEOPLE or "door" in words:
        return scope.Owner.NEIGHBOUR
    if set(words) & lex.MY:
        return scope.Owner.MINE
    if set(words) & lex.KIN:
        return scope.Owner.UNSAID
    return scope.Owner.SOMEONE


def _reset_by_mine(tokens: list[Token], phrase: Phrase) -> bool:
    return phrase.determiner in ("my", "our")


def _not_about_mine(text: str) -> bool:
    return " = not " in text or " is not mine " in text


def _corrected_between(tokens: list[Token], start: int, end: int) -> bool:
    if end - start > 10:
        return False
    words = [t.norm for t in tokens[start:end] if t.kind is not Kind.SYMBOL]
    text = " " + " ".join(words) + " "
    return any(f" {c} " in text for c in lex.CORRECTIONS if c not in ("actually", "in fact")) or words[:1] == ["no"]
