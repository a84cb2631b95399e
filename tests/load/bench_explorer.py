"""What a step of the contour explorer costs on one core: `python -m tests.load.bench_explorer --worlds 6`.

Whole searches in ray-cast worlds with views of the simulator's size; the clock is the process's own CPU time, so that
other work on the machine does not count. `step` is `navigation.explorer.explore.explore` without decoding; `packed` is
the map's way to text and back, as the service sends it.
"""

import argparse
import json
import sys
import time
from typing import Any

import numpy as np

from navigation.camera import Pose, pinhole
from navigation.explorer.explore import Memory, explore
from services.depth_assist.explorer import pack, unpack
from tests.navigation import usual
from tests.navigation.explorer_worlds import AROUND, SHAPES, make_task, views

MAX_STEPS = 30


def measure(worlds: int, pixels: int, first_seed: int) -> dict[str, Any]:
    """Searches without an end but their own, `worlds` of them: times in milliseconds, and the text's size."""
    steps: list[float] = []
    packs: list[float] = []
    sizes: list[int] = []
    kinds = [(shape, around) for around in AROUND for shape in SHAPES]
    for k in range(worlds):
        shape, around = kinds[k % len(kinds)]
        task = make_task(shape, around, first_seed + k)
        rng = np.random.default_rng(k)
        memory: Memory | None = None
        pose = task.start
        for _ in range(MAX_STEPS):
            seen = tuple(views(task, pose, pinhole(pixels, pixels, 90.0), rng, 0.01).values())
            began = time.process_time()
            done = explore(memory, seen, pose, usual.EXPLORER)
            steps.append(1e3 * (time.process_time() - began))
            began = time.process_time()
            text = pack(done.memory)
            memory = unpack(text)
            packs.append(1e3 * (time.process_time() - began))
            sizes.append(len(text))
            if done.decision.status == "done":
                break
            pose = Pose(done.decision.place[0], done.decision.place[1], pose.z, done.decision.yaw)
    return {
        "steps": len(steps),
        "pixels": pixels,
        "step_ms": _spread(steps),
        "packed_ms": _spread(packs),
        "map_bytes_most": max(sizes),
    }


def _spread(values: list[float]) -> dict[str, float]:
    return {f"p{q}": round(float(np.percentile(values, q)), 1) for q in (50, 95, 99, 100)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--worlds", type=int, default=6)
    parser.add_argument("--pixels", type=int, default=800)
    parser.add_argument("--first-seed", type=int, default=500)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    found = measure(options.worlds, options.pixels, options.first_seed)
    if options.json:
        sys.stdout.write(json.dumps(found) + "\n")
        return
    sys.stdout.write(f"{found['steps']} steps, views of {found['pixels']} x {found['pixels']} pixels\n")
    for name in ("step_ms", "packed_ms"):
        sys.stdout.write(f"{name:10} " + "  ".join(f"{q} {v}" for q, v in found[name].items()) + "\n")
    sys.stdout.write(f"map at most {found['map_bytes_most']} characters\n")


if __name__ == "__main__":
    main()
