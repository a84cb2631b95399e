"""What a language model wrote, as it really comes, to a floor and an object.

Reading
  Read        floor and object, each null where the model says that the request names none
  Refusal     the model declined
  Unreadable  anything else, with the problem in words that can be sent back to the model
"""

import ast
import json
import re
from dataclasses import dataclass
from typing import Any

from pydantic import ValidationError

from contracts.llm_parser import Relation
from services.llm_parser.chat.grounding import object_span

LONGEST_TEXT = 40_000
HIGHEST_FLOOR = 200
LONGEST_OBJECT = 200
_MOST_OBJECTS = 24
_KEYS = frozenset(("floor", "object", "relation", "floors", "objects", "sure"))

_TAG = r"(?:think|thinking|thought|thoughts|reasoning|reflection)"
_CLOSE = re.compile(rf"</{_TAG}>|<\|end_of_thought\|>", re.IGNORECASE)
_OPEN = re.compile(rf"<{_TAG}>|<\|begin_of_thought\|>", re.IGNORECASE)
_REFUSAL = re.compile(
    r"\b(?:i(?:'m| am) (?:sorry|afraid)\b.{0,40}\b(?:can(?:'t|not)|unable)|"
    r"i (?:can(?:'t|not)|won't|am unable to|'m unable to) "
    r"(?:help|assist|comply|do that|process|fulfil|provide|answer|continue)|"
    r"(?:unable|not able) to (?:help|assist|comply)|against my (?:guidelines|policy)|as an ai (?:language )?model)",
    re.IGNORECASE | re.DOTALL,
)
_QUOTES = str.maketrans({"“": '"', "”": '"', "’": "'", "‘": "'"})
_ORDINAL = re.compile(r"^\s*(\d{1,3})\s*(?:st|nd|rd|th)?\s*(?:floor)?\s*$", re.IGNORECASE)
_NOTHING = frozenset(("", "null", "none", "n/a", "unknown", "not specified", "missing"))


@dataclass(frozen=True, slots=True)
class Read:
    """`floors` and `objects`: what they may be where the model leaves them open; `sure`: 0..1, null where it does not
    say."""

    floor: int | None
    object: str | None
    relation: Relation | None = None
    floors: tuple[int, ...] = ()
    objects: tuple[str, ...] = ()
    sure: float | None = None


@dataclass(frozen=True, slots=True)
class Refusal:
    pass


@dataclass(frozen=True, slots=True)
class Unreadable:
    problem: str


@dataclass(frozen=True, slots=True)
class Reply:
    """One message of the model. `cut` says that it ran into the token limit."""

    content: str
    reasoning: str = ""
    refusal: bool = False
    cut: bool = False


def read_reply(reply: Reply, request: str, *, grounded: bool = True) -> Read | Refusal | Unreadable:
    """The answer in `reply`, checked against the closed schema, its bounds and, with `grounded`, the words of
    `request` (an object that was translated is in none of them)."""
    if reply.refusal:
        return Refusal()
    answer, thinking_only = _answer_part(reply)
    if thinking_only and reply.cut:
        return Unreadable("the reasoning was cut off before an answer")
    found = _last_object(answer.translate(_QUOTES))
    if found is None:
        if _REFUSAL.search(answer[:600].translate(_QUOTES)):
            return Refusal()
        return Unreadable("there is no JSON object in it")
    return _checked(found, request if grounded else None)


def _answer_part(reply: Reply) -> tuple[str, bool]:
    """What follows the reasoning, and whether there is nothing but reasoning."""
    content = reply.content[-LONGEST_TEXT:]
    closings = list(_CLOSE.finditer(content))
    if closings:
        return content[closings[-1].end() :], False
    opening = _OPEN.search(content)
    if opening is not None:
        return content[opening.end() :], True
    if not content.strip():
        return reply.reasoning[-LONGEST_TEXT:], True
    return content, False


def _last_object(text: str) -> dict[str, Any] | None:
    """The last readable JSON object of `text`, preferring one that has our keys."""
    fallback = None
    for candidate in reversed(_brace_pairs(text)):
        value = _lenient(candidate)
        if value is None:
            continue
        if "floor" in value or "object" in value:
            return value
        fallback = fallback or value
    return fallback


def _brace_pairs(text: str) -> list[str]:
    """The innermost and outer brace-delimited pieces, in order of their ends."""
    starts: list[int] = []
    pieces: list[str] = []
    for at, character in enumerate(text):
        if character == "{":
            starts.append(at)
        elif character == "}" and starts:
            start = starts.pop()
            if at - start <= 2000:
                pieces.append(text[start : at + 1])
    return pieces[-_MOST_OBJECTS:]


def _lenient(piece: str) -> dict[str, Any] | None:
    """JSON, or what models write for it: trailing commas, single quotes, bare keys, Python's constants, comments."""
    bare = re.sub(r"//[^\n\"]*$", "", piece, flags=re.MULTILINE)
    literal = re.sub(r"([{,]\s*)([A-Za-z_]\w*)\s*:", r'\1"\2":', bare)
    for constant, ours in (("null", "None"), ("true", "True"), ("false", "False")):
        literal = re.sub(rf"\b{constant}\b", ours, literal)
    for read, variant in ((json.loads, piece), (ast.literal_eval, literal)):
        try:
            value = read(variant)
        except (ValueError, SyntaxError, MemoryError, RecursionError):
            continue
        return value if isinstance(value, dict) else None
    return None


def _checked(found: dict[str, Any], request: str | None) -> Read | Unreadable:
    unknown = [str(key)[:40] for key in found if key not in _KEYS]
    if unknown:
        return Unreadable(f"it has keys that were not asked for: {', '.join(unknown[:4])}")
    if "floor" not in found or "object" not in found:
        return Unreadable("it lacks the key floor or object")
    floor = _floor(found["floor"])
    if isinstance(floor, Unreadable):
        return floor
    thing = found["object"]
    if thing is not None and not isinstance(thing, str):
        return Unreadable("the object is neither a string nor null")
    name = normalised(thing.strip().strip(".\"'")) if thing is not None else None
    if name is not None and name in _NOTHING:
        name = None
    if name is not None and len(name) > LONGEST_OBJECT:
        return Unreadable(f"the object is longer than {LONGEST_OBJECT} characters")
    if name is not None and request is not None and object_span(name, request) is None:
        return Unreadable("the object is not in the words of the request")
    floors = tuple(f for f in map(_floor, _list(found.get("floors"))) if isinstance(f, int))[:3]
    objects = tuple(
        normalised(str(o))[:LONGEST_OBJECT] for o in _list(found.get("objects")) if isinstance(o, str) and o
    )[:3]
    return Read(floor, name, _relation(found.get("relation")), floors, objects, _share(found.get("sure")))


def _list(value: object) -> list[Any]:
    return value if isinstance(value, list) else []


def _share(value: object) -> float | None:
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 <= value <= 1.0:
        return None
    return float(value)


def _relation(value: object) -> Relation | None:
    """A relation that is not well formed says nothing."""
    if not isinstance(value, dict):
        return None
    try:
        relation = Relation.model_validate({"count": 1, **value}, strict=False)
    except ValidationError:
        return None
    return relation.model_copy(update={"to": normalised(relation.to)})


def normalised(noun_phrase: str) -> str:
    """Lower case, single spaces, no article in front."""
    words = noun_phrase.lower().split()
    return " ".join(words[1:] if words and words[0] in ("a", "an", "the") else words)


def _floor(value: object) -> int | Unreadable | None:
    if value is None:
        return None
    if isinstance(value, str):
        if value.strip().lower() in _NOTHING:
            return None
        match = _ORDINAL.match(value)
        value = int(match.group(1)) if match else None
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    if isinstance(value, bool) or not isinstance(value, int):
        return Unreadable("the floor is neither an integer nor null")
    if not 1 <= value <= HIGHEST_FLOOR:
        return Unreadable(f"the floor is not within 1 and {HIGHEST_FLOOR}")
    return value
