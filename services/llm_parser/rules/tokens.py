"""Request text to tokens: words with their normal form, numbers with their value, breaks between clauses."""

import re
from dataclasses import dataclass, replace
from enum import Enum

from services.llm_parser.rules import spelling
from services.llm_parser.rules.lexicon import ARTICLES, FILLERS, FLOOR_NOUNS, PREPOSITIONS, words
from services.llm_parser.rules.numbers import CARDINALS, ORDINALS, read_number_words


class Kind(Enum):
    WORD = "word"
    CARDINAL = "cardinal"
    ORDINAL = "ordinal"
    CODE = "code"
    """A figure that is no count: money, a time, a telephone number, a flat number with a letter."""
    FLOOR_CODE = "floor code"
    """7F, 7/F, F7, L7."""
    SYMBOL = "symbol"
    """A sign inside a clause: comma, colon, dash, equals."""
    STOP = "stop"
    """The end of a sentence."""


@dataclass(slots=True)
class Token:
    """`norm` is lower case with slang and clear typos resolved; `value` is the number's; `sentence` counts from 0."""

    kind: Kind
    norm: str
    start: int
    end: int
    value: int = 0
    sentence: int = 0
    raw: str = ""
    repaired: bool = False

    @property
    def is_word(self) -> bool:
        return self.kind is Kind.WORD


_SCAN = re.compile(
    r"""
    (?P<money>[£$€]\s?\d[\d.,]{0,12}\d|[£$€]\s?\d|\d[\d.,]{0,12}\s?(?:[£$€]|kg\b|km\b|cm\b|mm\b|ml\b|g\b|m\b|%))
  | (?P<time>\d{1,2}[:.h]\d{2}(?:\s?[ap]\.?m\b\.?)?|\d{1,2}\s?[ap]\.?m\b\.?|\d{1,2}\s?o'?clock)
  | (?P<phone>\+\d[\d\s-]{5,}\d|\d{3,}[-\s]\d{3,}(?:[-\s]\d+)*|\d+(?:[-/]\d+){2,})
  | (?P<ordinal>\d{1,3}\s?(?:st|nd|rd|th)\b)
  | (?P<floorcode>\d{1,2}\s?/?F\b|\d{1,2}/?f\b|\b[FL]\d{1,2}\b)
  | (?P<decimal>\d{1,9}[.,]\d[\d.,]{0,12}\d|\d{1,9}[.,]\d\b)
  | (?P<code>\d+[A-Za-z]+\w*|[A-Za-z]+\d+\w*)
  | (?P<number>\d+)
  | (?P<with>\bw/o\b|\bw/)
  | (?P<word>[^\W\d_]+(?:'[^\W\d_]+)*(?:'?-[^\W\d_]+(?:'[^\W\d_]+)*)*)
  | (?P<stop>[.!?\n…]+)
  | (?P<symbol>[,:;=()\[\]"/|*~>→–—-])
  | (?P<sign>[@&\#+])
  | (?P<other>\S)
    """,
    re.VERBOSE,
)

MOST_TOKENS = 1200
"""The longest request in plain English has fewer; what comes behind is not read, so that the work stays bounded."""

_QUOTES = str.maketrans({"’": "'", "‘": "'", "“": '"', "”": '"', "`": "'", "´": "'", "‑": "-", "\u00a0": " "})

_ABBREVIATIONS = words("mr mrs ms dr no nr st flr apt fl lvl attn tel ext sr vs approx")

_EXPANSIONS: dict[str, tuple[str, ...]] = {
    "im": ("i", "am"),
    "ive": ("i", "have"),
    "ill": ("i", "will"),
    "its": ("its",),
    "youll": ("you", "will"),
    "theres": ("there", "is"),
    "thats": ("that", "is"),
    "dont": ("do", "not"),
    "doesnt": ("does", "not"),
    "isnt": ("is", "not"),
    "wasnt": ("was", "not"),
    "cant": ("can", "not"),
    "wont": ("will", "not"),
    "arent": ("are", "not"),
    "didnt": ("did", "not"),
    "can't": ("can", "not"),
    "won't": ("will", "not"),
    "cannot": ("can", "not"),
    "were": ("were",),
    "wheres": ("where", "is"),
    "whos": ("who", "is"),
    "hes": ("he", "is"),
    "shes": ("she", "is"),
    "theyre": ("they", "are"),
    "theyve": ("they", "have"),
    "weve": ("we", "have"),
    "hasnt": ("has", "not"),
    "u": ("you",),
    "ur": ("your",),
    "r": ("are",),
    "n": ("and",),
    "w": ("with",),
    "abt": ("about",),
    "nxt": ("next",),
    "da": ("the",),
    "gimme": ("give", "me"),
    "wanna": ("want", "to"),
    "gonna": ("going", "to"),
    "pls": ("please",),
    "plz": ("please",),
    "lookin": ("looking",),
    "outta": ("out", "of"),
    "dunno": ("do", "not", "know"),
    "neighbor": ("neighbour",),
    "neighbors": ("neighbours",),
    "neighboring": ("neighbouring",),
}
_SUFFIXES = {"m": "am", "re": "are", "ve": "have", "ll": "will", "d": "would"}
_IS_HOSTS = words("it that there here he she who what where this one everything mine ours where's name how")
_FOR_AFTER = words("look looking search searching watch wait waiting lookout out")
_TO_AFTER = words("next go come close fly up deliver bring send get head way back lift take")


def tokenize(text: str) -> list[Token]:
    """The tokens of `text`, in order. Hesitations are left out; positions refer to `text`."""
    plain = text.translate(_QUOTES)
    tokens: list[Token] = []
    sentence = 0
    for match in _SCAN.finditer(plain):
        if len(tokens) >= MOST_TOKENS:
            break
        group = match.lastgroup or "other"
        raw, start, end = match.group(), match.start(), match.end()
        if group == "word":
            _add_word(tokens, raw, start, sentence)
        elif group == "stop":
            if raw == "." and tokens and tokens[-1].norm in _ABBREVIATIONS and tokens[-1].end == start:
                continue
            tokens.append(Token(Kind.STOP, raw[0], start, end, sentence=sentence))
            sentence += 1
        elif group == "number":
            tokens.append(_number(tokens, raw, start, end, sentence))
        elif group == "ordinal":
            value = int(re.sub(r"\D", "", raw))
            tokens.append(Token(Kind.ORDINAL, raw.lower(), start, end, value, sentence, raw))
        elif group == "floorcode":
            value = int(re.sub(r"\D", "", raw))
            tokens.append(Token(Kind.FLOOR_CODE, raw.lower(), start, end, value, sentence, raw))
        elif group == "with":
            tokens.append(Token(Kind.WORD, "without" if "o" in raw else "with", start, end, 0, sentence, raw))
        elif group in ("symbol", "other"):
            tight = tokens and tokens[-1].end == start and plain[end : end + 1].isalpha()
            if raw == "-" and tight and tokens[-1].kind in (Kind.ORDINAL, Kind.CARDINAL):
                continue  # "7th-floor window", "28-storey tower"
            norm = "," if group == "other" else "-" if raw in "–—~" else raw
            tokens.append(Token(Kind.SYMBOL, norm, start, end, sentence=sentence))
        elif group == "sign":
            norm = {"@": "at", "&": "and", "#": "number", "+": "and"}[raw]
            tokens.append(Token(Kind.WORD, norm, start, end, 0, sentence, raw))
        else:
            tokens.append(Token(Kind.CODE, raw.lower(), start, end, 0, sentence, raw))
    return _join_number_words(_untangle(tokens))


_SPOKEN_SIGNS = {"comma": ",", "colon": ":", "semicolon": ";", "dash": "-", "hyphen": "-"}
_AFTER_IT_IS = words("the a an on in not at my number got level lvl floor storey like next right just still near up by")


def _untangle(tokens: list[Token]) -> list[Token]:
    """ "its the" is "it is the", "their is" is "there is", and a dictated "comma" or "full stop" is a sign."""
    out: list[Token] = []
    sentence_shift = 0
    for index, token in enumerate(tokens):
        token.sentence += sentence_shift
        following = tokens[index + 1] if index + 1 < len(tokens) else None
        if not token.is_word:
            out.append(token)
        elif token.norm == "its" and following is not None and _after_it_is(following):
            it, be = replace(token, norm="it"), replace(token, norm="is")
            out += [it, be]
        elif token.norm == "were" and _opens(out) and following is not None and following.norm in _AFTER_WE_ARE:
            out += [replace(token, norm="we"), replace(token, norm="are")]
        elif token.norm == "their" and following is not None and following.norm in ("is", "are", "'s"):
            out.append(replace(token, norm="there"))
        elif token.norm in _SPOKEN_SIGNS:
            out.append(replace(token, kind=Kind.SYMBOL, norm=_SPOKEN_SIGNS[token.norm]))
        elif token.norm == "full" and following is not None and following.norm == "stop":
            out.append(replace(token, kind=Kind.STOP, norm="."))
            following.kind, following.norm = Kind.STOP, "."
            sentence_shift += 1
        elif token.norm == "period" and (following is None or following.raw[:1].islower()):
            out.append(replace(token, kind=Kind.STOP, norm="."))
            sentence_shift += 1
        else:
            out.append(token)
    return out


_AFTER_WE_ARE = words("on at in up the now still moving waiting back")


def _opens(out: list[Token]) -> bool:
    """Does a clause begin behind `out`?"""
    return not out or not out[-1].is_word


def _after_it_is(token: Token) -> bool:
    return token.norm in _AFTER_IT_IS or token.norm in CARDINALS or token.norm in ORDINALS or not token.is_word


def _number(tokens: list[Token], raw: str, start: int, end: int, sentence: int) -> Token:
    before = tokens[-1].norm if tokens else ""
    if raw == "4" and before in _FOR_AFTER:
        return Token(Kind.WORD, "for", start, end, 0, sentence, raw)
    if raw == "2" and before in _TO_AFTER:
        return Token(Kind.WORD, "to", start, end, 0, sentence, raw)
    value = int(raw) if len(raw) <= 4 else 10**6
    return Token(Kind.CARDINAL, raw, start, end, value, sentence, raw)


def _add_word(tokens: list[Token], raw: str, start: int, sentence: int) -> None:
    if "-" in raw:
        parts = raw.lower().split("-")
        if _names_floor(parts):
            offset = start
            for part in raw.split("-"):
                if part:
                    _add_word(tokens, part, offset, sentence)
                offset += len(part) + 1
            return
    word = raw.lower()
    end = start + len(raw)
    after_article = bool(tokens) and tokens[-1].norm in ARTICLES
    if word in FILLERS:
        return
    expanded = _EXPANSIONS.get(word)
    if expanded is None and "'" in word:
        expanded = _apostrophe(word) if "'-" not in word else None
    if expanded is None:
        norm, repaired = spelling.repair(word)
        if after_article and norm in _NEVER_AFTER_ARTICLE:
            norm, repaired = word, False  # "a bedside lamp" is no slip for "a beside lamp"
        expanded = tuple(norm.split())
    else:
        repaired = False
    for norm in expanded:
        tokens.append(Token(Kind.WORD, norm, start, end, 0, sentence, raw, repaired))


_BESIDE_FLOORS = words("ground top upper lower same number window")


def _names_floor(parts: list[str]) -> bool:
    """Is a hyphenated word the name of a floor ("ninth-floor") or a number, and no thing's ("two-handled")?"""
    numbers = [p in CARDINALS or p in ORDINALS for p in parts]
    nouns = [p in FLOOR_NOUNS for p in parts]
    told = (any(numbers) and any(nouns)) or all(numbers)
    return told or (
        (any(numbers) or any(nouns))
        and all(n or m or p in _BESIDE_FLOORS for p, n, m in zip(parts, numbers, nouns, strict=True))
    )


_NEVER_AFTER_ARTICLE = PREPOSITIONS - words("next opposite close closest nearest adjacent outside inside")


def _apostrophe(word: str) -> tuple[str, ...]:
    host, _, tail = word.rpartition("'")
    if tail in _SUFFIXES:
        return (host, _SUFFIXES[tail])
    if tail == "t" and host.endswith("n"):
        return (host[:-1], "not")
    if tail == "s":
        return (host, "is") if host in _IS_HOSTS else (host, "'s")
    return (word.replace("'", ""),)


def _join_number_words(tokens: list[Token]) -> list[Token]:
    """Number words become number tokens: "twenty first" is one ordinal, "twelve oh three" one cardinal."""
    joined: list[Token] = []
    at = 0
    while at < len(tokens):
        token = tokens[at]
        if token.is_word and (token.norm in CARDINALS or token.norm in ORDINALS):
            words = [t.norm if t.is_word else "" for t in tokens[at : at + 6]]
            symbols = [t.norm for t in tokens[at : at + 2]]
            read = read_number_words(words)
            last = tokens[at + read.used - 1]
            kind = Kind.ORDINAL if read.ordinal else Kind.CARDINAL
            joined.append(
                Token(
                    kind, " ".join(words[: read.used]) or symbols[0], token.start, last.end, read.value, token.sentence
                )
            )
            joined[-1].raw = joined[-1].norm
            at += read.used
        else:
            joined.append(token)
            at += 1
    return joined
