"""What a model did badly, the worst first: surest wrong claims, plainest things missed, floors counted wrong."""

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

from contracts.sim import VisibleObject
from evaluation.model_evaluation.asking import Answers
from evaluation.model_evaluation.cases import Case, RenderedLook
from evaluation.model_evaluation.drawing import Tile
from evaluation.model_evaluation.judged import Judged
from evaluation.subtasks.recognition import meets
from mission.wording import with_article

EACH = 6
FLOOR_TILES = 4


def tiles(
    held: Sequence[Judged], cases: Mapping[int, Case], answers: Answers, folder: Path, each: int = EACH
) -> list[Tile]:
    """A few of each kind, at most one of a street. `folder` holds the pictures."""
    wrong = sorted((j for j in held if j.claims_wrongly), key=lambda j: -j.claims[0].confidence)
    missed = sorted((j for j in held if j.clear and not j.found), key=lambda j: -(j.best.pixels if j.best else 0))
    found = [_wrong(j, folder) for j in _one_a_street(wrong)[:each]]
    found += [_missed(j, folder) for j in _one_a_street(missed)[:each]]
    return found + _miscounted(cases, answers, folder)[:FLOOR_TILES]


def taken_for(held: Sequence[Judged]) -> list[tuple[str, str, int]]:
    """What was asked for, what was claimed instead, how often; the most frequent first."""
    counts: Counter[tuple[str, str]] = Counter()
    for j in held:
        if j.claims_wrongly:
            counts[f"{j.asked.colour or ''} {j.asked.kind or j.asked.phrase}".strip(), _claimed(j)] += 1
    return [(asked, claimed, n) for (asked, claimed), n in counts.most_common()]


def _one_a_street(held: Sequence[Judged]) -> list[Judged]:
    first: dict[int, Judged] = {}
    for j in held:
        first.setdefault(j.case.seed, j)
    return list(first.values())


def _wrong(j: Judged, folder: Path) -> Tile:
    claim = j.claims[0]
    wanted = next((t for t in _in_view(j.look, claim.camera) if (t.kind, t.colour) == _asked(j)), None)
    note = f"claimed with {claim.confidence:.2f}: {_claimed(j)}"
    return Tile(
        folder / _picture(j.look, claim.camera), claim.box, wanted.box if wanted else None, j.asked.phrase, note
    )


def _missed(j: Judged, folder: Path) -> Tile:
    thing = j.best
    assert thing is not None
    camera = next(v.camera for v in j.look.truth if any(t is thing for t in v.objects))
    near = [m.confidence for m in j.asked.matches if m.camera == camera and meets(m.box, thing.box)]
    seen = f"seen with {max(near):.2f} only" if near else "not seen at all"
    if j.asked.outcome == "refused":
        seen = "said to be unknown"
    note = f"{seen}; {thing.distance_m:.1f} m, {thing.pixels} px, {100 * thing.share:.0f} % visible"
    return Tile(folder / _picture(j.look, camera), None, thing.box, j.asked.phrase, note)


def _miscounted(cases: Mapping[int, Case], answers: Answers, folder: Path) -> list[Tile]:
    found = []
    for counted in answers.counted:
        front = cases[counted.seed].fronts[counted.front]
        truth = front.truth.floors_visible
        off = truth if counted.floors is None else abs(counted.floors - truth)
        box = front.truth.building_box
        if off and front.number and box is not None:
            note = f"counted {counted.floors if counted.floors is not None else 'nothing'}, {truth} in view"
            title = f"floors of a {cases[counted.seed].building.replace('_', ' ')}"
            found.append((off, Tile(folder / front.picture, counted.box, box, title, note)))
    found.sort(key=lambda item: -item[0])
    return [tile for _, tile in found]


def _claimed(j: Judged) -> str:
    """What is really there where the surest claim is."""
    claim = j.claims[0]
    there = [t for t in _in_view(j.look, claim.camera) if meets(claim.box, t.box)]
    if not there:
        return "no thing at all"
    best = max(there, key=lambda t: t.pixels)
    return with_article(f"{best.colour} {best.kind.replace('_', ' ')}")


def _asked(j: Judged) -> tuple[str | None, str | None]:
    return j.asked.kind, j.asked.colour


def _in_view(look: RenderedLook, camera: str) -> tuple[VisibleObject, ...]:
    return next((view.objects for view in look.truth if view.camera == camera), ())


def _picture(look: RenderedLook, camera: str) -> str:
    return next(picture for c, picture in zip(look.cameras, look.pictures, strict=True) if c.name == camera)
