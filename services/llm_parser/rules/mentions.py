"""Where a request names a floor and which one: ordinals, numbers, the ground, the top, totals."""

from typing import NamedTuple

from services.llm_parser.rules import lexicon as lex
from services.llm_parser.rules.lexicon import words
from services.llm_parser.rules.relatives import DOWN, HIGHEST, UP, FloorMention, with_relatives
from services.llm_parser.rules.tokens import Kind, Token

_BUILDINGS = words(
    "building tower block house high-rise highrise skyscraper apartment tenement complex hotel residence monster "
    "giant beast condo"
)
_LINKS = words("number no nr num is : = - the called marked # uh it was ( says my should read be to")
_NO_FLOOR_BEFORE = words(
    "apt apartment ap flat unit suite room house code gate order telephone phone ext extension invoice door parcels "
    "at age aged of past half about around for pin bus route lane line item items"
)
_COUNTING = words("of more past to times")
DISPLAYS = words("says say reads shows show display written press push button marked labelled labeled saying")


class Mentions(NamedTuple):
    """The mentions from left to right, and the tokens that speak of floors in any way (totals included)."""

    found: tuple[FloorMention, ...]
    taken: frozenset[int]


def find_mentions(tokens: list[Token]) -> Mentions:
    """Every mention of a floor in `tokens`; the score is that of its form alone."""
    finder = _Finder(tokens)
    finder.scan()
    return Mentions(tuple(finder.found), frozenset(finder.taken))


class _Finder:
    def __init__(self, tokens: list[Token]) -> None:
        self._tokens = tokens
        self._size = len(tokens)
        self.found: list[FloorMention] = []
        self.taken: set[int] = set()
        self._total: int | None = None
        self._tops: list[int] = []

    def _norm(self, at: int) -> str:
        return self._tokens[at].norm if 0 <= at < self._size else ""

    def _kind(self, at: int) -> Kind | None:
        return self._tokens[at].kind if 0 <= at < self._size else None

    def _add(self, first: int, last: int, floor: int, score: float) -> None:
        if 1 <= floor <= HIGHEST:
            self.found.append(FloorMention(first, last, floor, score))
            self.taken.update(range(first, last))

    def scan(self) -> None:
        at = 0
        while at < self._size:
            token = self._tokens[at]
            step = 0
            if token.kind is Kind.ORDINAL:
                step = self._ordinal(at)
            elif token.kind is Kind.CARDINAL:
                step = self._cardinal(at)
            elif token.kind is Kind.FLOOR_CODE:
                self._add(at, at + 1, token.value, 4.0)
                step = 1
            elif token.is_word and token.norm in lex.FLOOR_NOUNS:
                step = self._floor_noun(at)
            elif token.is_word and token.norm in ("top", "highest", "uppermost", "topmost", "penthouse"):
                step = self._top(at)
            at += step or 1
        self._resolve_tops()
        self.found = with_relatives(self._tokens, self.found, self.taken)

    def _ordinal(self, at: int) -> int:
        value = self._tokens[at].value
        if self._norm(at + 1) in lex.FLOOR_NOUNS:
            self._add(at, at + 2, value, 5.0)
            return 2
        if self._norm(at + 1) in ("to", "from") and self._norm(at + 3) in ("top", "last") and self._total is None:
            return 0
        if self._norm(at + 1) in ("to", "from") and self._norm(at + 2) in ("last", "the"):
            return 0
        before = self._norm(at - 1)
        following = self._tokens[at + 1] if at + 1 < self._size else None
        if self._norm(at + 1) in ("and", "or") and self._kind(at + 2) is Kind.ORDINAL:
            self._add(at, at + 1, value, 2.0)
            return 1
        if following is not None and following.is_word and not self._ends_ordinal(following.norm):
            return 0
        if before in lex.TIMES or self._norm(at + 1) == "of" or before in ("may", "march"):
            return 0
        words_before = {self._norm(at - k) for k in (1, 2, 3, 4)}
        if before == "the" or before in (
            "on",
            "to",
            "in",
            "for",
            "at",
            ":",
            "=",
            "no",
            "actually",
            "sorry",
            "now",
            "*",
        ):
            placed = bool(words_before & {"on", "to", "up", "from", "floor", "live", "at", "in", "no", "say", "saying"})
            again = any(mention.floor == value for mention in self.found)
            small = (
                value <= 2
                and not again
                and self._norm(at + 1) not in ("i", "we", "that", "now")
                and self._tokens[at].raw.isalpha()
                and not words_before & {"on", "floor", "up", "to"}
            )
            self._add(at, at + 1, value, (2.5 if placed else 1.5) - (2.0 if small else 0.0))
            return 1
        if self._is_clause(at):
            self._add(at, at + 1, value, 0.3)
            return 1
        return 0

    def _ends_ordinal(self, word: str) -> bool:
        return word in lex.CLOSED and word not in ("hand", "place", "time", "try", "second", "one", "is the")

    def _cardinal(self, at: int) -> int:
        token = self._tokens[at]
        value = token.value
        noun = at + 1 + (self._norm(at + 1) == "the")
        before = self._norm(at - 1)
        if self._norm(noun) in lex.FLOOR_NOUNS and value <= HIGHEST:
            following = {self._norm(noun + 1), self._norm(noun + 2)}
            plural = self._norm(noun) in lex.PLURAL_FLOOR_NOUNS
            if plural and self._norm(noun + 1) in ("up", "high") and not self._is_base_ahead(noun + 2):
                self._add(at, noun + 2, value, 3.5)
                return noun + 2 - at
            if self._norm(noun + 1) in UP | DOWN and not (plural and before in ("and", "has", "have", "with")):
                return 0
            if plural or following & _BUILDINGS or (before in ("a", "an", "this", "the") and following & {"tall"}):
                self.taken.update(range(at, noun + 1))
                if value > 1:
                    self._total = max(self._total or 0, value)
                return noun + 1 - at
            if self._kind(noun + 1) is not Kind.CARDINAL or noun > at + 1:
                self._add(at, noun + 1, value, 4.0)
                return noun + 1 - at
            return 0
        if value > HIGHEST or (token.raw.isdigit() and len(token.raw) > 3):
            return 0
        score = self._bare_cardinal(at)
        if score:
            self._add(at, at + 1, value, score)
            return 1
        return 0

    def _bare_cardinal(self, at: int) -> float:
        """What speaks for a number alone being a floor: "up on twelve", "number 7!", "it says 7 in the lift"."""
        if self._norm(at) == "one" and not (self._norm(at - 2) == "up" or self._norm(at - 1) in ("number", "not")):
            return 0.0
        before, second, third = self._norm(at - 1), self._norm(at - 2), self._norm(at - 3)
        following = self._tokens[at + 1] if at + 1 < self._size else None
        counts = following is not None and following.is_word and following.norm not in lex.CLOSED - _COUNTING
        if counts and following is not None:
            return self._corrected_number(at) if following.norm not in lex.TIMES else 0.0
        if following is not None and following.kind is Kind.CODE:
            return 0.0
        if before in ("on", "at", "to") and second == "up":
            return 4.0
        if before == "up":
            return 2.5
        if before == "on" and self._norm(at + 1) not in lex.TIMES:
            return 2.5
        if before in ("number", "no", "nr") and second not in _NO_FLOOR_BEFORE:
            return 2.5 if before == "number" else 2.0
        if following is not None and following.norm == "not" and self._kind(at + 2) is Kind.CARDINAL:
            said = {t.norm for t in self._tokens[max(0, at - 14) : at]}
            return 2.5 if said & lex.FLOOR_NOUNS or before in ("is", ":") else 1.0
        lift = {t.norm for t in self._tokens[max(0, at - 9) : at + 8]} & {
            "lift",
            "elevator",
            "button",
            "floor",
            "level",
        }
        if before in DISPLAYS or (before in (":", "is") and second in DISPLAYS):
            return 3.0 if lift else 1.5
        if before in ("is", "am", "to") and lift and second in ("it", "that", "this", "floor", "go", "i", "come"):
            return 2.0
        if self._norm(at + 1) in ("in", "on") and self._norm(at + 3) in ("lift", "elevator"):
            return 2.5
        if third == "floor" and second in ("is", "says"):
            return 2.0
        ahead = [t.norm for t in self._tokens[at + 1 : at + 6] if t.norm not in (",", "'s", "is")]
        if ahead[:2] == ["that", "the"] and ahead[2:3] and ahead[2] in lex.FLOOR_NOUNS:
            return 4.0
        if before in ("now", "currently", "formerly"):
            return 1.5
        return self._corrected_number(at) or (0.3 if self._is_clause(at) else 0.0)

    def _is_clause(self, at: int) -> bool:
        """A number between two stops and behind no label: "... . 10. Go."."""
        breaks = (Kind.STOP, Kind.SYMBOL, None)
        labelled = self._norm(at - 1) in (":", "=", "(")
        return self._kind(at - 1) in breaks and self._kind(at + 1) in breaks and not labelled

    def _corrected_number(self, at: int) -> float:
        """A number set against an earlier one: "I wrote 5 on the form but it is 7", "floor five no wait six"."""
        near = [t.norm for t in self._tokens[max(0, at - 6) : at]]
        text = " " + " ".join(near) + " "
        marked = any(f" {c} " in text for c in lex.CORRECTIONS) or " but " in text or " not " in text or " no " in text
        earlier = any(
            self._kind(i) in (Kind.CARDINAL, Kind.ORDINAL) and self._tokens[i].value <= HIGHEST
            for i in range(max(0, at - 14), at)
        )
        following = self._norm(at + 1)
        if following in lex.TIMES or (following and following in lex.NON_OBJECTS and following not in lex.CLOSED):
            return 0.0
        if self._norm(at - 1) in _NO_FLOOR_BEFORE:
            return 0.0
        if marked and earlier:
            return 2.0
        if self._norm(at + 1) == "on" and self._norm(at + 3) in ("form", "order", "app"):
            return 0.5
        return 0.0

    def _floor_noun(self, at: int) -> int:
        noun = self._norm(at)
        if self._norm(at - 1) in ("ground", "street", "entry") or (
            self._norm(at - 1) == "bottom" and noun not in lex.PLURAL_FLOOR_NOUNS
        ):
            self._add(at - 1, at + 1, 1, 5.0)
            return 1
        ahead = at + 1
        if self._norm(ahead) == "," and self._norm(ahead + 1) in ("which", "that"):
            ahead += 2  # "the floor, which is the second"
        while ahead < self._size and ahead - at <= 5:
            kind = self._kind(ahead)
            if kind is Kind.CARDINAL or kind is Kind.ORDINAL:
                return self._after_noun(at, ahead)
            if self._norm(ahead) not in _LINKS and not (ahead == at + 1 and self._is_label(at)):
                break
            ahead += 1
        if self._kind(at + 1) is Kind.FLOOR_CODE:
            return 0
        return 0

    def _is_label(self, at: int) -> bool:
        """ "Floor, twenty-eight." """
        breaks = (Kind.STOP, Kind.SYMBOL, None)
        return self._norm(at + 1) == "," and self._kind(at - 1) in breaks and self._kind(at + 3) in breaks

    def _after_noun(self, at: int, ahead: int) -> int:
        token = self._tokens[ahead]
        following = self._tokens[ahead + 1] if ahead + 1 < self._size else None
        goes_on = (
            following is not None
            and following.is_word
            and (not self._ends_ordinal(following.norm) or following.norm in lex.FLOOR_NOUNS)
        )
        if token.kind is Kind.ORDINAL and goes_on:
            return 0
        if self._norm(at) in lex.PLURAL_FLOOR_NOUNS and token.kind is Kind.CARDINAL:
            self._total = max(self._total or 0, token.value) if token.value <= HIGHEST else self._total
            self.taken.update(range(at, ahead + 1))
            return ahead + 1 - at
        if following is not None and following.norm in lex.FLOOR_NOUNS and ahead > at + 1:
            return 0
        if token.value > HIGHEST:
            return 0
        self._add(at, ahead + 1, token.value, 5.0)
        return ahead + 1 - at

    def _top(self, at: int) -> int:
        if self._norm(at) == "penthouse" or self._norm(at + 1) in lex.FLOOR_NOUNS:
            self._tops.append(at)
            return 2
        if (
            self._norm(at) == "top"
            and self._norm(at - 1) == "the"
            and self._norm(at + 1) not in ("of", "left", "right")
            and (self._kind(at + 1) is not Kind.WORD or self._norm(at + 1) in lex.CLOSED)
        ):
            rel = {self._norm(at - 2), self._norm(at - 3)}
            if rel & (DOWN | {"from"}) or self._norm(at - 2) in ("at", "to"):
                self._tops.append(at)
                return 1
        return 0

    def _resolve_tops(self) -> None:
        """The top floor is a number only where the request says how many there are."""
        for at in self._tops:
            width = 2 if self._norm(at + 1) in lex.FLOOR_NOUNS else 1
            self.taken.update(range(at, at + width))
            if self._total:
                below = self._tokens[at - 3].value - 1 if self._norm(at - 2) == "from" and at >= 3 else 0
                ordinal = below > 0 and self._kind(at - 3) is Kind.ORDINAL
                first = at - 3 if ordinal else at
                self._add(first, at + width, self._total - (below if ordinal else 0), 3.0)

    def _is_base_ahead(self, at: int) -> bool:
        ahead = [self._norm(i) for i in range(at, at + 2)]
        return "from" in ahead or "than" in ahead
