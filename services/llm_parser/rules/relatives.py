"""Floors told by another one: "two floors above the fourth", "one below the top", "... but we are one higher"."""

from dataclasses import dataclass

from services.llm_parser.rules import lexicon as lex
from services.llm_parser.rules.lexicon import words
from services.llm_parser.rules.tokens import Kind, Token

HIGHEST = 200
UP = words("above over higher up")
DOWN = words("below under beneath underneath lower down")
_NO_PLACE = words("and has have with are is")
"""In front of "five floors above it" these tell how tall the building is, not where somebody lives."""


@dataclass(frozen=True, slots=True)
class FloorMention:
    """Tokens `first` to `last` (exclusive) name `floor`; `score` is how much speaks for it, `doubt` the part of it
    that is held against a mention for being some third person's."""

    first: int
    last: int
    floor: int
    score: float
    doubt: float = 0.0


def with_relatives(tokens: list[Token], found: list[FloorMention], taken: set[int]) -> list[FloorMention]:
    """`found` from left to right, with relative floors in the place of the floors that they start from; the tokens
    they use are added to `taken`."""
    finder = _Relatives(tokens, taken)
    return finder.behind_previous(finder.before_base(sorted(found, key=lambda m: m.first)))


class _Relatives:
    def __init__(self, tokens: list[Token], taken: set[int]) -> None:
        self._tokens = tokens
        self._size = len(tokens)
        self._taken = taken

    def _norm(self, at: int) -> str:
        return self._tokens[at].norm if 0 <= at < self._size else ""

    def _kind(self, at: int) -> Kind | None:
        return self._tokens[at].kind if 0 <= at < self._size else None

    def before_base(self, found: list[FloorMention]) -> list[FloorMention]:
        """ "two floors above the fourth", "the floor below the ninth"."""
        out: list[FloorMention] = []
        for base in found:
            shift = self._shift_before(base.first)
            if shift is None:
                out.append(base)
                continue
            first, offset = shift
            value = base.floor + offset
            if 1 <= value <= HIGHEST:
                out.append(FloorMention(first, base.last, value, base.score + 3.0))
                self._taken.update(range(first, base.last))
        return sorted(out, key=lambda m: m.first)

    def behind_previous(self, found: list[FloorMention]) -> list[FloorMention]:
        """ "... but we are one floor higher": relative to the floor named just before."""
        named = {i for m in found for i in range(m.first, m.last)}
        made: list[FloorMention] = []
        ahead = 0
        base: FloorMention | None = None
        for at in range(self._size - 2):
            while ahead < len(found) and found[ahead].last <= at:
                base, ahead = found[ahead], ahead + 1
            token = self._tokens[at]
            if token.kind is not Kind.CARDINAL or at in named or base is None:
                continue
            noun = self._norm(at + 1) in lex.FLOOR_NOUNS
            word = self._norm(at + 1 + noun)
            above_it = noun and word in ("above", "below") and self._norm(at + 3) in ("that", "it")
            if word in ("higher", "lower") or (above_it and self._norm(at - 1) not in _NO_PLACE):
                value = base.floor + (token.value if word in ("higher", "above") else -token.value)
                if 1 <= value <= HIGHEST:
                    base = FloorMention(at, at + 2 + noun, value, base.score + 3.0)
                    made.append(base)
                    self._taken.update(range(at, at + 2 + noun))
        return sorted([*found, *made], key=lambda m: m.first)

    def _shift_before(self, base: int) -> tuple[int, int] | None:
        at = base - 1
        limit = max(0, base - 7)
        while at >= limit and self._norm(at) not in UP | DOWN | {"from", "than"}:
            if self._tokens[at].kind in (Kind.STOP, Kind.SYMBOL) or self._norm(at) in ("to", "and", "but", "i", "we"):
                return None
            at -= 1
        if at < limit:
            return None
        if self._norm(at) in ("from", "than"):
            at -= 1
        word = self._norm(at)
        if word not in UP | DOWN:
            return None
        sign = 1 if word in UP else -1
        before = at - 1
        if self._norm(before) == "directly" or self._norm(before) in ("just", "right", "immediately", "straight"):
            before -= 1
            if self._norm(before) not in lex.FLOOR_NOUNS:
                return (before + 1, sign)
        had_noun = self._norm(before) in lex.FLOOR_NOUNS
        if had_noun:
            before -= 1
        if self._norm(before) == "more":
            before -= 1
        if self._kind(before) is Kind.CARDINAL and self._tokens[before].value < 100:
            return (before, sign * self._tokens[before].value)
        if had_noun and self._norm(before) in ("the", "a", "next", "very", "one"):
            return (before, sign)
        if self._norm(before) == "one" or self._norm(before) == "single":
            return (before, sign)
        return None
