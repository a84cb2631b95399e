"""How good the embedded model is: `python -m services.vlm_gateway.embedded.evaluate DIRECTORY [DIRECTORY ...]`.

Pictures come from `python -m vld.embedded_pictures`, of seeds the model was not fitted to. Each scene's goal is asked
for in every view: "seen" counts views in which at least 40 % of it shows within 10 m. A claim is false where no thing
of that class and colour is.
"""

import argparse
import json
import sys
import time
from collections import Counter
from pathlib import Path

from contracts.geometry import Box
from contracts.sim import VisibleObject
from services.vlm_gateway.embedded.fit import Shown, pictures
from services.vlm_gateway.embedded.seen import Still
from services.vlm_gateway.embedded.simple import SimpleModel as EmbeddedModel

NEAR_M = 10.0
MIN_SHARE = 0.4
MIN_PIXELS = 60


def goal_of(shown: list[Shown]) -> dict[str, VisibleObject]:
    """Each scene's goal, from a view that shows it."""
    return {s.label.scene: o for s in shown for o in s.label.truth.objects if o.goal}


def meets(box: Box, thing: Box) -> bool:
    """Does the claim's middle lie in the thing's box grown by half its size?"""
    x, y = (box.x_min + box.x_max) / 2, (box.y_min + box.y_max) / 2
    w, h = (thing.x_max - thing.x_min) / 2, (thing.y_max - thing.y_min) / 2
    return thing.x_min - w <= x <= thing.x_max + w and thing.y_min - h <= y <= thing.y_max + h


def overlap(a: tuple[float, float], b: tuple[float, float]) -> float:
    """Intersection over union of two stretches."""
    both = min(a[1], b[1]) - max(a[0], b[0])
    return max(0.0, both) / (max(a[1], b[1]) - min(a[0], b[0]))


def measure(model: EmbeddedModel, shown: list[Shown]) -> dict[str, object]:
    """Counts as `k/n` and seconds a picture; the keys say what they count."""
    goals = goal_of(shown)
    phrases = {kind: model.phrase_of(kind) for kind in {g.kind for g in goals.values()}}
    counts: Counter[str] = Counter()
    seconds = 0.0
    frames = 0
    box_overlap: list[float] = []
    wrong: Counter[str] = Counter()
    missed: Counter[str] = Counter()
    for one in shown:
        rgb, truth = one.rgb, one.label.truth
        if one.label.frontal:
            seen = model.count_floors(Still(rgb))
            off = abs(seen.count - len(truth.floor_rows))
            counts["frontal"] += 1
            counts["floors exact"] += off == 0
            counts["floors within one"] += off <= 1
            found = model.building_box(Still(rgb))
            if truth.building_box is not None:
                b = truth.building_box
                mine = found.box if found else None
                box_overlap.append(overlap((b.y_min, b.y_max), (mine.y_min, mine.y_max)) if mine else 0.0)
            continue
        goal = goals.get(one.label.scene)
        if goal is None:
            continue
        started = time.process_time()
        claims = model.find_object([Still(rgb)], f"{goal.colour} {phrases[goal.kind]}").sightings
        seconds += time.process_time() - started
        frames += 1
        alike = [o for o in truth.objects if (o.kind, o.colour) == (goal.kind, goal.colour)]
        visible = [o for o in alike if o.distance_m <= NEAR_M and o.share >= MIN_SHARE and o.pixels >= MIN_PIXELS]
        false = [c for c in claims if not any(meets(c.box, o.box) for o in alike)]
        counts["views"] += 1
        counts["views with a false claim"] += bool(false)
        if false:
            wrong[f"{goal.colour} {goal.kind}"] += 1
        if visible:
            counts["seen"] += 1
            hit = any(meets(c.box, o.box) for c in claims for o in visible)
            counts["seen and found"] += hit
            counts["seen and best claim right"] += bool(claims) and any(meets(claims[0].box, o.box) for o in visible)
            if not hit:
                missed[f"{goal.colour} {goal.kind}"] += 1
    return {
        "floors exact": f"{counts['floors exact']}/{counts['frontal']}",
        "floors within one": f"{counts['floors within one']}/{counts['frontal']}",
        "building box, mean overlap of rows": round(sum(box_overlap) / max(1, len(box_overlap)), 3),
        "goal found where seen": f"{counts['seen and found']}/{counts['seen']}",
        "best claim right where seen": f"{counts['seen and best claim right']}/{counts['seen']}",
        "views with a false claim": f"{counts['views with a false claim']}/{counts['views']}",
        "seconds for five views, one core": round(seconds / max(1, frames) * 5, 3),
        "missed": dict(missed.most_common(12)),
        "claimed falsely": dict(wrong.most_common(12)),
    }


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m services.vlm_gateway.embedded.evaluate", description="Measure the model on labelled pictures."
    )
    parser.add_argument("folders", type=Path, nargs="+")
    chosen = parser.parse_args(arguments)
    sys.stdout.write(json.dumps(measure(EmbeddedModel(), list(pictures(chosen.folders))), indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
