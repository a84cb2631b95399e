"""Which of the floors that a request names is the customer's: the form and the context of each mention, added up."""

from collections import Counter
from dataclasses import dataclass, replace

from services.llm_parser.rules import lexicon as lex
from services.llm_parser.rules import sayings, scope
from services.llm_parser.rules.lexicon import words
from services.llm_parser.rules.mentions import DISPLAYS, find_mentions
from services.llm_parser.rules.relatives import FloorMention
from services.llm_parser.rules.tokens import Token

_PREDICATES = words(
    "has have had does do owns keeps always never will would is are was tends thinks steals likes loves gets"
)
_PERSONS_AND_PLACES = lex.ANCHORS | lex.DWELLINGS | words("i we us me")
_GO_THERE = words("deliver bring send come go fly take drop leave route now live proceed head climb reach")
_WENT = words("went came landed rang walked knocked climbed flew")
_OWN_NOW = words("i we my our now please")
_GOODS = words("order parcel package delivery this that it")
_AFTER_NO = words("the it on that is floor level not")


@dataclass(frozen=True, slots=True)
class Floors:
    """All mentions, and the tokens that speak of floors in any way (totals included)."""

    mentions: tuple[FloorMention, ...]
    taken: frozenset[int]

    def best(self) -> FloorMention | None:
        """The mention that most speaks for, where anything does."""
        good = [m for m in self.mentions if m.score > 0]
        if not good:
            good = [replace(m, score=m.score + m.doubt) for m in self.mentions if m.score + m.doubt > 1.0]
        if not good:
            return None
        times = Counter(m.floor for m in good)
        return max(good, key=lambda m: (m.score + 0.5 * times[m.floor], m.first))


def find_floors(tokens: list[Token]) -> Floors:
    """Every mention of a floor in `tokens`, scored in its context."""
    found, taken = find_mentions(tokens)
    mentions = [_in_context(tokens, found, index) for index in range(len(found))]
    wanted = scope.mine_is_the(tokens)
    if wanted is not None:
        named = [m for m in mentions if m.score > 0 and m.last <= wanted.at]
        if len(named) >= 2:
            # each window was named with its floor: "second" counts windows here, not floors
            return Floors((wanted.of(named),), taken)
    return Floors(tuple(mentions), taken)


def _in_context(tokens: list[Token], found: tuple[FloorMention, ...], index: int) -> FloorMention:
    mention = found[index]
    start = found[index - 1].last if index else 0
    end = found[index + 1].first if index + 1 < len(found) else len(tokens)
    back = {t.norm for t in tokens[max(start, mention.first - 8) : mention.first]}
    owner = scope.owner_before(tokens, mention.first, start)
    doubt = 5.0 if owner is scope.Owner.SOMEONE else 0.0
    score = mention.score + 0.1 * index - doubt
    score += {scope.Owner.MINE: 2.0, scope.Owner.NEIGHBOUR: -6.0}.get(owner, 0.0)
    if scope.negated(tokens, mention.first, start):
        score -= 9.0
    shown = bool(back & DISPLAYS) and mention.score < 4.0
    if not shown and scope.past(tokens, mention.first):
        score -= 6.0
    if back & _GO_THERE:
        score += 1.5
    if {"for", "is"} <= {t.norm for t in tokens[max(start, mention.first - 4) : mention.first]} and back & _GOODS:
        score += 3.0
    following = tokens[mention.last].norm if mention.last < len(tokens) else ""
    if following in _PREDICATES and not back & _PERSONS_AND_PLACES:
        score -= 3.0
    if back & _WENT and not back & _OWN_NOW:
        score -= 3.0
    if "press" in back:
        score -= 3.0
    if sayings.denied_after(sayings.after(tokens, mention.last, end)):
        score -= 6.0
    if end < len(tokens):
        score -= _taken_back(tokens, mention.last, end)
    return replace(mention, score=score, doubt=doubt)


def _taken_back(tokens: list[Token], start: int, end: int) -> float:
    """How much what stands between two mentions, tokens `start` to `end`, speaks against the first of them."""
    if end - start >= 20:
        return 0.0
    between = [t.norm for t in tokens[start:end]]
    against = 2.0 if set(between) & {"but", "however", "though"} else 0.0
    return against + (9.0 if end - start <= 16 and _corrected(tokens, start, end) else 0.0)


def _corrected(tokens: list[Token], start: int, end: int) -> bool:
    """Does a correction, or a further move, stand between two mentions?"""
    moved = any(t.norm in ("moved", "relocated") for t in tokens[max(0, start - 18) : start])
    if moved and any(t.norm in ("later", "then", "afterwards", "finally") for t in tokens[start:end]):
        return True
    said = [t.norm for t in tokens[max(start, end - 8) : end] if t.is_word]
    text = " " + " ".join(said) + " "
    if any(f" {phrase} " in text for phrase in lex.CORRECTIONS):
        return True
    plain_no = any(w == "no" and (said[k + 1 : k + 2] or ["the"])[0] in _AFTER_NO for k, w in enumerate(said))
    return plain_no or "sorry" in said[-4:] or "wait" in said[-4:]
