"""Which of the noun phrases marks the customer's window: cues and context of each phrase, added up."""

from collections.abc import Set
from dataclasses import dataclass, replace

from services.llm_parser.rules import cues, sayings, scope
from services.llm_parser.rules import lexicon as lex
from services.llm_parser.rules.cues_before import before
from services.llm_parser.rules.cues_behind import behind
from services.llm_parser.rules.lexicon import words
from services.llm_parser.rules.phrases import Phrase
from services.llm_parser.rules.tokens import Kind, Token

THRESHOLD = 0.7
"""A phrase for which less speaks than this is not taken: a missing object is said, not guessed."""

LEAST = -2.1
"""What stands alone in a request as the only thing named may have this little, and nothing that denies it."""

MOST_THINGS = 100
"""So many things of a request are weighed; nobody's window needs more, and the work stays bounded."""


@dataclass(frozen=True, slots=True)
class ScoredPhrase:
    """`doubt` is the part of the score that is held against a phrase for belonging to some third person."""

    phrase: Phrase
    score: float
    doubt: float = 0.0


def choose_object(tokens: list[Token], phrases: list[Phrase], taken: Set[int]) -> Phrase | None:
    """The phrase that most speaks for being the mark, or None where none does. `taken` are tokens that name floors."""
    scored = score_phrases(tokens, phrases, taken)
    good = [s for s in scored if s.score >= THRESHOLD]
    if not good:
        good = [replace(s, score=s.score + s.doubt) for s in scored if s.score + s.doubt >= THRESHOLD + 1.0]
    if not good:
        good = [s for s in scored if _stands_alone(tokens, s, taken)]
    if not good:
        return None
    best = max(good, key=lambda s: s.score).phrase
    return _fullest(tokens, best, scored)


def score_phrases(tokens: list[Token], phrases: list[Phrase], taken: Set[int]) -> list[ScoredPhrase]:
    """Every phrase that names a thing, with its score."""
    things = [p for p in phrases if _names_thing(tokens, p)][:MOST_THINGS]
    solid = [_is_solid(tokens, p) for p in things]
    scored = [_score(tokens, things, solid, i, taken) for i in range(len(things))]
    wanted = scope.mine_is_the(tokens)
    if wanted is not None:
        marked = [i for i, s in enumerate(scored) if s.score > 2.0 or _in_one_other(tokens, s.phrase)]
        if len(marked) >= 2:
            chosen = wanted.of(marked)
            scored[chosen] = replace(scored[chosen], score=scored[chosen].score + 12.0)
    return scored


_NO_COMPOUND = (
    lex.FLOOR_NOUNS
    | lex.ANCHORS
    | lex.TIMES
    | words(
        "reception lobby gate door lift elevator front back entry entrance security order apartment flat unit zip "
        "phone building"
    )
)


def _stands_alone(tokens: list[Token], scored: ScoredPhrase, taken: Set[int]) -> bool:
    """May a phrase be the mark for want of a better: said with an article and like a thing, or a clause of its own?"""
    phrase = scored.phrase
    head = tokens[phrase.head]
    long = phrase.last - phrase.first > 1
    if phrase.determiner in ("a", "an") or (
        phrase.determiner in ("the", "my", "our") and (long or cues.own_worth(tokens, phrase) > 0)
    ):
        return scored.score >= LEAST and phrase.head != 0
    named = head.raw[:1].isupper() and phrase.lead > 0
    return scored.score >= -0.25 and cues.is_clause(tokens, phrase, taken) and not named and len(head.norm) > 2


_KEYBOARD = ("qwertyuiop", "asdfghjkl", "zxcvbnm", "qwertzuiop", "azertyuiop")


def _is_gibberish(word: str) -> bool:
    """Fingers on the keyboard: a run of neighbouring keys, or letters that no English word has in a row."""
    if len(word) < 4 or not word.isalpha() or not word.isascii():
        return False
    run = any(word in row or word[::-1] in row for row in _KEYBOARD)
    return run or not set(word) & set("aeiouy") or any(word[i : i + 2] not in ("qu", "q") for i in _at(word, "q"))


def _at(word: str, letter: str) -> list[int]:
    return [i for i, c in enumerate(word) if c == letter]


_PETS = words("cat dog hamster parrot rabbit budgie cats dogs puppy kitten")
_ALONE_TOO = words("bell heart sun keyboard robot wheel castle elephant pizza cake telephone phone face hand")


def _names_thing(tokens: list[Token], phrase: Phrase) -> bool:
    head = tokens[phrase.head].norm
    own = {tokens[i].norm for i in range(phrase.first, phrase.head)}
    if phrase.determiner == "another" or any(_is_gibberish(word) for word in own | {head}):
        return False
    if head in lex.KIN or head in lex.PEOPLE:
        return bool(own & lex.FIGURE_STUFF)
    if head not in lex.NON_OBJECTS:
        return True
    if phrase.determiner in ("a", "an") and head in _ALONE_TOO:
        return True
    if head in lex.BUILDINGS and tokens[phrase.head].raw[:1].isupper() and phrase.head > 0:
        return False  # "Marlow House"
    if head in lex.PARCEL_NOUNS and own & (lex.COLOURS | {"gift"}):
        return True
    if head in lex.MEASURE_NOUNS and phrase.last > phrase.head + 1:
        return True
    if head in ("marker", "mark"):
        return False
    compound = head in lex.SOFT_NOUNS and phrase.head > phrase.first
    return compound and (head == "box" or tokens[phrase.first].norm not in _NO_COMPOUND)


def _score(tokens: list[Token], things: list[Phrase], solid: list[bool], index: int, taken: Set[int]) -> ScoredPhrase:
    phrase = things[index]
    earlier = [p for p, sure in zip(things[:index], solid, strict=False) if sure]
    later = [p for p, sure in zip(things[index + 1 :], solid[index + 1 :], strict=True) if sure]
    start = earlier[-1].last if earlier else 0
    if earlier and start == phrase.lead - 1 and tokens[start].norm == "is":
        start = earlier[-1].lead  # "my mark is a ...": the subject belongs to the context
    end = later[0].lead if later else len(tokens)
    said = before(tokens, phrase, start) + behind(tokens, phrase, end)
    score = cues.own_worth(tokens, phrase) + cues.alone(tokens, phrase, taken) + said
    owner, doubt = _owner(tokens, phrase, start), 0.0
    if owner is scope.Owner.NEIGHBOUR:
        score -= 9.0
    elif owner is scope.Owner.SOMEONE:
        doubt = 7.0
    elif owner is scope.Owner.MINE:
        if phrase.determiner in ("my", "our") and tokens[phrase.head].norm in _PETS and len(phrase.words) == 1:
            score -= 3.0
        score += 0.5 if phrase.determiner not in ("my", "our") else 1.5 if said > 0.5 else 0.5
    if scope.negated(tokens, phrase.lead, start):
        score -= 10.0
    if scope.past(tokens, phrase.lead, was_within=1):
        score -= 5.0
    text = sayings.after(tokens, phrase.last, end)
    if sayings.denied_after(text):
        score -= 9.0
    elif sayings.confirmed_after(text):
        score += 4.0
    if later and _corrected_between(tokens, phrase.last, later[0].lead):
        score -= 8.0
    repeats = sum(
        tokens[o.head].norm == tokens[phrase.head].norm and set(o.words) <= set(phrase.words)
        for o in things
        if o is not phrase
    )
    return ScoredPhrase(phrase, score + 1.5 * repeats - doubt - 0.05 * index, doubt)


def _is_solid(tokens: list[Token], phrase: Phrase) -> bool:
    """Surely a thing of its own, at which the context of its neighbours ends; a lone unknown word may be anything."""
    return bool(phrase.determiner) or phrase.last - phrase.first > 1 or cues.own_worth(tokens, phrase) > 0


def _owner(tokens: list[Token], phrase: Phrase, start: int) -> scope.Owner:
    if phrase.determiner in ("my", "our"):
        return scope.Owner.MINE
    if phrase.determiner in ("his", "her", "their"):
        return scope.Owner.SOMEONE
    if phrase.determiner != "'s":
        return scope.owner_before(tokens, phrase.lead, start)
    possessor = {tokens[i].norm for i in range(phrase.lead, phrase.first)}
    if possessor & lex.PEOPLE or "door" in possessor:
        return scope.Owner.NEIGHBOUR
    if possessor & lex.MY:
        return scope.Owner.MINE
    return scope.Owner.UNSAID if possessor & lex.KIN else scope.Owner.SOMEONE


def _fullest(tokens: list[Token], best: Phrase, scored: list[ScoredPhrase]) -> Phrase:
    """The same thing by its longer name, where the request has one: "a brass lantern ... the lantern hangs ..."."""
    if best.determiner in ("a", "an"):
        return best
    head = tokens[best.head].norm
    same = [
        s.phrase
        for s in scored
        if s.score > -3.0 and tokens[s.phrase.head].norm == head and set(s.phrase.words) > set(best.words)
    ]
    return max(same, key=lambda p: len(p.words)) if same else best


def _in_one_other(tokens: list[Token], phrase: Phrase) -> bool:
    nearby = tokens[max(0, phrase.lead - 4) : phrase.lead]
    return any(t.norm in ("one", "other", "first", "second") for t in nearby)


def _corrected_between(tokens: list[Token], start: int, end: int) -> bool:
    """Does a correction stand between two phrases: "the blue vase, sorry, I mean the blue teapot"?"""
    if end - start > 10:
        return False
    said = [t.norm for t in tokens[start:end] if t.kind is not Kind.SYMBOL]
    text = " " + " ".join(said) + " "
    return any(f" {c} " in text for c in lex.CORRECTIONS if c not in ("actually", "in fact")) or said[:1] == ["no"]
