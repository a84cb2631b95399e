"""Are these words the request's own? A model may shorten and reorder, not invent."""

import re

from rapidfuzz.distance import OSA

_WORD = re.compile(r"[^\W_]+")
_LINK_WORDS = "a an the of with and in on at by to for its his her my our from or"
_LINKS = frozenset(_LINK_WORDS.split())


def object_span(name: str, request: str) -> slice | None:
    """The shortest stretch of `request` that holds all words of `name` that carry meaning, or None where one is
    missing. Plural and singular count as the same word, and so do words of five letters or more one slip apart."""
    wanted = {w for w in _WORD.findall(name.lower()) if w not in _LINKS}
    said = _WORD.finditer(request.lower())
    hits = [(m, found) for m in said if (found := {w for w in wanted if _same(w, m.group())})]
    spans = []
    for at, (first, _) in enumerate(hits):
        left = set(wanted)
        for last, found in hits[at:]:
            left -= found
            if not left:
                spans.append(slice(first.start(), last.end()))
                break
    return min(spans, key=lambda s: s.stop - s.start, default=None)


def _same(wanted: str, said: str) -> bool:
    if wanted == said or wanted.rstrip("s") == said.rstrip("s"):
        return True
    return min(len(wanted), len(said)) >= 5 and OSA.distance(wanted, said, score_cutoff=1) <= 1
