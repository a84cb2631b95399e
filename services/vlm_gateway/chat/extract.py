"""From what a model wrote to JSON values: without its reasoning, out of fences and prose."""

import json
import re
from typing import NamedTuple

MAX_TEXT = 40_000
MAX_CANDIDATES = 48

_TAGS = ("think", "thinking", "thought", "reasoning", "reflection")
_CLOSED = re.compile(r"<(" + "|".join(_TAGS) + r")>.*?</\1>", re.DOTALL | re.IGNORECASE)
_END = re.compile(r"</(?:" + "|".join(_TAGS) + r")>", re.IGNORECASE)
_START = re.compile(r"<(?:" + "|".join(_TAGS) + r")>", re.IGNORECASE)
_FENCE = re.compile(r"```[A-Za-z0-9_-]*[ \t]*\n?(.*?)```", re.DOTALL)
_REFUSAL = re.compile(
    r"\b(?:i(?:'|’)?m sorry|i am sorry|i apologi[sz]e|i (?:can(?:no|')t|can’t|can not|am unable|am not able|"
    r"won(?:'|’)t|will not|must decline)|unable to (?:determine|assist|help|provide|answer|tell)|"
    r"(?:not |im)possible to (?:determine|say|tell|give|provide|count|answer)|"
    r"(?:cannot|can(?:'|’)t) be determined|difficult to determine|"
    r"against my (?:guidelines|policy)|as an ai)\b",
    re.IGNORECASE,
)


class Words(NamedTuple):
    """`answer` is what is left without the reasoning; `reasoned` is whether there was any."""

    answer: str
    reasoned: bool


def without_reasoning(text: str) -> Words:
    """Takes reasoning tags out: closed pairs, an end without a start (templates that open the tag themselves), and a
    start without an end (cut off while still reasoning: nothing of an answer is left)."""
    left = _CLOSED.sub(" ", text)
    if ends := list(_END.finditer(left)):
        left = left[ends[-1].end() :]
    start = _START.search(left)
    if start is not None:
        left = left[: start.start()]
    return Words(left.strip(), left != text)


def looks_like_refusal(text: str) -> bool:
    """Whether prose without any JSON declines to answer."""
    return bool(_REFUSAL.search(text[:2000]))


def json_values(text: str) -> list[object]:
    """Every JSON value that the text may mean, most likely first: all of it, fenced blocks from the last to the
    first, then objects and lists inside prose from the last to the first."""
    text = text[:MAX_TEXT]
    found: list[object] = []
    for piece in (text.strip(), *(fence.strip() for fence in reversed(_FENCE.findall(text)))):
        value = _whole(piece)
        if value is not _NOTHING:
            found.append(value)
    found.extend(reversed(_inside(text)))
    return found[:MAX_CANDIDATES]


_NOTHING = object()


def _refuse_constant(name: str) -> float:
    raise ValueError(f"{name} is not JSON")


_DECODER = json.JSONDecoder(parse_constant=_refuse_constant)


def _whole(piece: str) -> object:
    try:
        return _DECODER.decode(piece) if piece else _NOTHING
    except (ValueError, RecursionError):
        return _NOTHING


def _inside(text: str) -> list[object]:
    found: list[object] = []
    at, tries = 0, 0
    while tries < MAX_CANDIDATES:
        starts = [place for place in (text.find("{", at), text.find("[", at)) if place >= 0]
        if not starts:
            break
        at, tries = min(starts), tries + 1
        try:
            value, at = _DECODER.raw_decode(text, at)
        except (ValueError, RecursionError):
            at += 1
            continue
        found.append(value)
    return found
