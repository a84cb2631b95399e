"""What is asked about each look, decided by the street's seed and the truth, never by what a model answers.

goal        the customer's thing, shown or not
seen        something else that shows
twin        something that shows, in a colour in which it does not: the red flower pot beside the green one
namesake    the colour of something that shows, on a thing that does not: the red kettle where a red mug stands
unknown     what no catalogue has
"""

import zlib
from collections.abc import Iterable, Sequence
from typing import Literal, NamedTuple

import numpy as np

from contracts.sim import Catalogue, CatalogueEntry, VisibleObject
from evaluation.model_evaluation.cases import Case, RenderedLook
from evaluation.task_set.requests import noun_phrase

Role = Literal["goal", "seen", "twin", "namesake", "unknown"]
NEAR_M, CLEAR_SHARE, CLEAR_PIXELS = 10.0, 0.6, 200
"""From within this distance, so much and so many pixels of a thing make it clear: the goal of the recall."""
VISIBLE_PIXELS = 40
UNKNOWN = (
    "gramophone",
    "spinning wheel",
    "sewing machine",
    "watering hose",
    "surfboard",
    "grand piano",
    "fire extinguisher",
    "bust of a poet",
    "microwave oven",
    "chess board",
    "violin",
    "tennis racket",
    "wheelchair",
    "doll house",
    "flower pot stand",
    "typewriter",
    "solar panel",
    "bookend",
    "hammock",
    "telescope",
)


class Thing(NamedTuple):
    """A class in a colour."""

    kind: str
    colour: str


class Asked(NamedTuple):
    """One question about a look; `thing` is null for what no catalogue has."""

    role: Role
    phrase: str
    thing: Thing | None


def questions(case: Case, number: int, catalogue: Catalogue) -> list[Asked]:
    """About look `number` of a case; the goal's first."""
    look = case.looks[number]
    rng = np.random.default_rng((case.seed, number, zlib.crc32(b"questions")))
    goal = Thing(case.kind, case.colour)
    asked = [Asked("goal", case.object, goal)]
    seen = visible(look)
    others = [thing for thing in seen if thing != goal]
    clear = [thing for thing in others if any(is_clear(o) for o in seen[thing])]
    known = {entry.kind: entry for entry in catalogue.entries}
    for pool in (clear, others):
        left = [thing for thing in pool if thing not in {a.thing for a in asked}]
        if left:
            thing = left[int(rng.integers(len(left)))]
            asked.append(Asked("seen", _said(known[thing.kind], thing.colour, catalogue, rng), thing))
    shown = clear + [goal] * any(is_clear(o) for o in seen.get(goal, ()))
    for role, alike in (("twin", _twins), ("namesake", _namesakes)):
        absent = [t for thing in shown for t in alike(thing, catalogue) if t not in seen]
        if absent:
            thing = absent[int(rng.integers(len(absent)))]
            phrase = _said(known[thing.kind], thing.colour, catalogue, rng)
            asked.append(Asked("twin" if role == "twin" else "namesake", phrase, thing))
    if number == 0:
        colour = ("", "red ", "green ", "blue ")[int(rng.integers(4))]
        asked.append(Asked("unknown", colour + UNKNOWN[int(rng.integers(len(UNKNOWN)))], None))
    return asked


def visible(look: RenderedLook) -> dict[Thing, list[VisibleObject]]:
    """All that shows at all, with each view of it that has some pixels, in a fixed order."""
    found: dict[Thing, list[VisibleObject]] = {}
    for view in look.truth:
        for thing in view.objects:
            found.setdefault(Thing(thing.kind, thing.colour), []).append(thing)
    return {key: found[key] for key in sorted(found)}


def is_clear(thing: VisibleObject) -> bool:
    return thing.distance_m <= NEAR_M and thing.share >= CLEAR_SHARE and thing.pixels >= CLEAR_PIXELS


def _twins(thing: Thing, catalogue: Catalogue) -> Iterable[Thing]:
    return (Thing(e.kind, c) for e in catalogue.entries if e.kind == thing.kind for c in e.colours if c != thing.colour)


def _namesakes(thing: Thing, catalogue: Catalogue) -> Iterable[Thing]:
    return (
        Thing(e.kind, thing.colour) for e in catalogue.entries if e.kind != thing.kind and thing.colour in e.colours
    )


def _said(entry: CatalogueEntry, colour: str, catalogue: Catalogue, rng: np.random.Generator) -> str:
    """In the catalogue's own words, or as often by a synonym that means nothing else."""
    own = [name for name in entry.synonyms if _meanings(name, catalogue.entries) == 1]
    if own and rng.random() < 0.5:
        return f"{colour} {own[int(rng.integers(len(own)))]}"
    return noun_phrase(entry, colour)


def _meanings(name: str, entries: Sequence[CatalogueEntry]) -> int:
    return sum(name in (e.phrase, *e.synonyms) for e in entries)
