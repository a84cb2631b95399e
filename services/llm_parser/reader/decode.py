"""From the network's scores to a floor, an object and a relation, each with a probability."""

import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from contracts.llm_parser import Side
from services.llm_parser.reader.floors import Reading
from services.llm_parser.reader.mentions import Mention

Floats = NDArray[np.float32]

SIDES: tuple[Side, ...] = ("left", "right", "above", "below")
MOST_SPANS = 60
AGREE = 0.7
MOST_ATTRIBUTE_WORDS = 3
TAGGED, TAGGED_COLOUR = 2.0, -0.5
"""From these logits on a token belongs to the object; the second is a colour's, for what else has none."""
_COLOURS = """red orange yellow green blue purple pink brown black white grey gray violet turquoise teal silver gold
golden beige cream navy scarlet crimson maroon lime mint lilac mauve copper bronze brass"""
COLOURS = frozenset(_COLOURS.split())
_COLOUR_BEHIND = re.compile(
    rf"(?P<thing>.*\w)(?:\s*[(,:;–—]+\s*|\s+-+\s*)(?:(?:the |in )?colou?r(?: is|:)?\s+)?(?P<colour>{'|'.join(COLOURS)})"
)
_STOPS = "a an the my our your his her its their this that one some with of in on at by and or made shaped like"
_STOP = frozenset((*_STOPS.split(), "which", "is", "are", "for", "from", "w"))
_ARTICLE_BEFORE = re.compile(r"\b(?:a|an|one|\d+)\s+$", re.IGNORECASE)
_COUNT_OPENS = re.compile(r"(?:^|[.!?;\n])\s*(?:one|\d+ ?x?)\s+$", re.IGNORECASE)
_NO_NOUNS = """ones? kind type sort model version variety colou?r they it he she we you i not too please now here there
after before but because since so if when where while as than then against behind beside under above over near next like
until up down out"""
_NOUN_BEHIND = re.compile(rf"\s+(?!(?:{'|'.join(_NO_NOUNS.split())})\b)([^\W\d_]+)", re.IGNORECASE)
_FLOOR_WORDS = re.compile(
    r"(?:[\s,;:.()-]|\b(?:and|on|at|in|the|is|it'?s|our|my|floor|flr|fl|level|lvl|storey|story|no|number)\b)*$",
    re.IGNORECASE,
)
_LEADING = re.compile(r"^(?:(?:a|an|the|my|our|your|some|one|this|that|his|her|its)\b[\s,]*)+", re.IGNORECASE)


class Scores(NamedTuple):
    """What the network says of a request of T tokens with M mentions. `whole`: none of floor, object and relation, then
    the relation's sides and counts. `ones`: (M, operations), `pairs`: (M, M, operations), `objects` and `anchors`:
    (T, span tokens), `tags`: (T,) logits of belonging to the object."""

    whole: Floats
    ones: Floats
    pairs: Floats
    objects: Floats
    anchors: Floats
    tags: Floats


class Tokens(NamedTuple):
    """The request's tokens as characters (start, end); special ones are empty."""

    text: str
    offsets: Sequence[tuple[int, int]]

    def span(self, at: int, width: int) -> tuple[int, int]:
        """The characters of entry `at` of a flattened table (T, `width`): from a token over so many further ones."""
        first, more = divmod(at, width)
        return self.offsets[first][0], self.offsets[min(first + more, len(self.offsets) - 1)][1]


class FloorGuess(NamedTuple):
    """A floor (null: not said, or not to be guessed), its probability, and the words of its likeliest reading."""

    floor: int | None
    probability: float
    start: int = 0
    end: int = 0


class ObjectGuess(NamedTuple):
    """A phrase (null: no mark of the customer's own), the probability of it and its like, and where it stands."""

    phrase: str | None
    probability: float
    start: int = 0
    end: int = 0


class RelationGuess(NamedTuple):
    """The customer's window is so many `windows` to the `side` of the one with `anchor`."""

    anchor: str
    side: Side
    windows: int
    probability: float


def floors(scores: Scores, readings: Sequence[Reading], mentions: Sequence[Mention]) -> list[FloorGuess]:
    """Most probable first; the probabilities sum to 1."""
    values = [scores.whole[0]]
    for r in readings:
        values.append(
            scores.ones[r.first, r.operation] if r.second is None else scores.pairs[r.first, r.second, r.operation]
        )
    share = _softmax(np.array(values, np.float32))
    summed: dict[int | None, float] = {None: float(share[0])}
    best: dict[int | None, tuple[float, Reading]] = {}
    for r, p in zip(readings, share[1:], strict=True):
        summed[r.floor] = summed.get(r.floor, 0.0) + float(p)
        if r.floor not in best or p > best[r.floor][0]:
            best[r.floor] = (float(p), r)
    guesses = []
    for floor, probability in summed.items():
        start = end = 0
        if floor in best:
            at = [mentions[i] for i in (best[floor][1].first, best[floor][1].second) if i is not None]
            start, end = min(m.start for m in at), max(m.end for m in at)
        guesses.append(FloorGuess(floor, probability, start, end))
    return sorted(guesses, key=lambda g: -g.probability)


def objects(scores: Scores, tokens: Tokens, floor: FloorGuess) -> list[ObjectGuess]:
    """Most probable first, each with what is said of it elsewhere in the request. A span that reaches over the words
    that the `floor` is read from ends before them."""
    share = _softmax(np.concatenate((scores.whole[1:2], scores.objects.reshape(-1))))
    top = np.argsort(-share[1:])[:MOST_SPANS]
    spans: list[tuple[float, int, int, frozenset[str]]] = []
    for at in top:
        p = float(share[1 + at])
        if p < 1e-4:
            break
        start, end = _beside_floor(tokens.text, *tokens.span(int(at), scores.objects.shape[1]), floor)
        words = content(tokens.text[start:end])
        if words and (start, end) == _widened(tokens.text, start, end):
            spans.append((p, start, end, words))
    guesses = [ObjectGuess(None, float(share[0]))]
    while spans:
        same = [sum(q for q, _, _, w in spans if w == words) for _, _, _, words in spans]
        best = max(range(len(spans)), key=lambda i: (round(same[i], 4), spans[i][0]))
        _, start, end, words = spans[best]
        alike = [s for s in spans if similar(words, s[3])]
        phrase = _phrase(tokens, start, end, scores.tags)
        guesses.append(ObjectGuess(phrase, sum(s[0] for s in alike), start, end))
        spans = [s for s in spans if s not in alike]
    return sorted(guesses, key=lambda g: -g.probability)


def relation(scores: Scores, tokens: Tokens) -> RelationGuess | None:
    """Null where the request describes no window by another one."""
    share = _softmax(np.concatenate((scores.whole[2:3], scores.anchors.reshape(-1))))
    if share[0] >= 0.5:
        return None
    start, end = tokens.span(int(np.argmax(share[1:])), scores.anchors.shape[1])
    sides, counts = scores.whole[3 : 3 + len(SIDES)], scores.whole[3 + len(SIDES) :]
    anchor = _clean(tokens.text[start:end])
    return RelationGuess(anchor, SIDES[int(np.argmax(sides))], 1 + int(np.argmax(counts)), 1.0 - float(share[0]))


def content(text: str) -> frozenset[str]:
    """The words that carry meaning, in lower case and without a plural's s."""
    plain = re.sub(r"'s\b", "", text.lower().replace("w/", " with ").replace("’", "'"))
    found = re.sub(r"[^\w]+", " ", plain).split()
    return frozenset(w[:-1] if len(w) > 3 and w.endswith("s") and not w.endswith("ss") else w for w in found) - _STOP


def agreement(a: frozenset[str], b: frozenset[str]) -> float:
    """F1 of two sets of words."""
    common = len(a & b)
    return 2 * common / (len(a) + len(b)) if common else 0.0


def similar(a: frozenset[str], b: frozenset[str]) -> bool:
    """May two sets of words name the same thing: mostly the same, or one within the other?"""
    common = len(a & b)
    return bool(common) and (common == min(len(a), len(b)) or agreement(a, b) >= AGREE)


def _beside_floor(text: str, start: int, end: int, floor: FloorGuess) -> tuple[int, int]:
    """The span, cut before the words of the floor where it holds them; empty where it begins with them."""
    if floor.floor is None or end <= floor.start or start >= floor.end:
        return start, end
    if start >= floor.start:
        return start, start
    said = text[start : floor.start]
    return start, start + len(_FLOOR_WORDS.sub("", said))


def _phrase(tokens: Tokens, start: int, end: int, tags: Floats) -> str:
    """The words of the span, and what the tagger adds from elsewhere: attributes in front, longer additions behind."""
    main = _clean(tokens.text[start:end])
    if (behind := _COLOUR_BEHIND.fullmatch(main)) and not content(behind["thing"]) & COLOURS:
        main = f"{behind['colour']} {behind['thing']}"
    known = content(main)
    groups: list[tuple[int, int]] = []
    for (s, e), tag in zip(tokens.offsets, tags, strict=True):
        if tag <= TAGGED or e <= s or (e > start and s < end):
            continue
        if groups and s - groups[-1][1] <= 1:
            groups[-1] = (groups[-1][0], e)
        else:
            groups.append((s, e))
    groups = [group for group in groups if not _of_another_thing(tokens.text, *group, known)]
    added = [_clean(tokens.text[slice(*_widened(tokens.text, *group))]) for group in groups]
    added = [a for a in added if content(a) - known]
    if not any(content(said) & COLOURS for said in (main, *added)):
        added += _colour_elsewhere(tokens, start, end, tags)
    short = [a for a in added if len(a.split()) <= MOST_ATTRIBUTE_WORDS]
    long = [a for a in added if len(a.split()) > MOST_ATTRIBUTE_WORDS]
    return " ".join([*short, main, *long])[:200]


def _of_another_thing(text: str, start: int, end: int, known: frozenset[str]) -> bool:
    """Stand the words before a noun that is not the object's, as in "the payload is a model locomotive", or open a
    sentence as goods do, with how many there are: "One turkey crown"?"""
    before = text[:start]
    another = _before_another_noun(text, end, known) and bool(_ARTICLE_BEFORE.search(before))
    return another or bool(_COUNT_OPENS.search(before))


def _before_another_noun(text: str, end: int, known: frozenset[str]) -> bool:
    noun = _NOUN_BEHIND.match(text, end)
    return bool(noun and content(noun[1]) - known - COLOURS)


def _colour_elsewhere(tokens: Tokens, start: int, end: int, tags: Floats) -> list[str]:
    """The colour outside of the span that is likeliest to be the object's; none where none is likely to be, or where it
    stands before another thing: "gold trophy" is no gold ribbon."""
    known = content(tokens.text[start:end])
    elsewhere = [
        (float(tag), word)
        for (s, e), tag in zip(tokens.offsets, tags, strict=True)
        if tag > TAGGED_COLOUR and s < e and (e <= start or s >= end)
        if (word := tokens.text[slice(*_widened(tokens.text, s, e))].lower()) in COLOURS
        and not _before_another_noun(tokens.text, e, known)
    ]
    return [max(elsewhere)[1]] if elsewhere else []


def _widened(text: str, start: int, end: int) -> tuple[int, int]:
    """The span, and the rest of the words that it begins or ends within."""
    while start > 0 and text[start - 1].isalnum() and text[start].isalnum():
        start -= 1
    while end < len(text) and text[end].isalnum() and text[end - 1].isalnum():
        end += 1
    return start, end


def _clean(text: str) -> str:
    said = re.sub(r"\s+", " ", text.lower().replace("w/", "with ")).strip(" .,;:!?()[]\"'“”‘’-–—*#/|=>")
    return _LEADING.sub("", said)


def _softmax(values: Floats) -> Floats:
    shifted: Floats = np.exp(values - values.max())
    shifted /= shifted.sum()
    return shifted
