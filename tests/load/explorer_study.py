"""The explorer against the paper's rule in ray-cast worlds: `python -m tests.load.explorer_study --worlds 3 --json`.

Six ground plans x none / street / ring x `--worlds` seeds; a perfect recogniser (12 m, 65 degrees, line of sight), 30
steps, moves of at most 10 m through the same corridor check for every policy. SPL counts the way flown plus the way
from the stop that saw the window to the place before it. `ideal` is the SPL of somebody who knows the map but not the
window and guesses the side by a coin; no lap that looks for the window can do better than that on average.
"""

import argparse
import json
import math
import sys
import time
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evaluation.metrics.coverage import in_view
from evaluation.metrics.proportion import share
from evaluation.metrics.spl import Flown, spl
from evaluation.task_set.task_files import load
from navigation import safe_distance, viewpoint
from navigation.camera import DepthView, Pose, move_pose, pinhole
from navigation.explorer.explore import Memory, explore
from navigation.explorer.parameters import ExplorerParameters
from navigation.shortest_path import NoWay
from tests.navigation import usual
from tests.navigation.explorer_worlds import (
    AROUND,
    SHAPES,
    Task,
    before,
    ideal_share,
    make_task,
    nearest_m,
    sees_window,
)
from tests.navigation.explorer_worlds import views as look
from tests.navigation.raycast_world import HEADINGS, units
from tests.navigation.scene_worlds import from_scene

MAX_STEPS = 30
RADIUS_M = 0.35


class Move(NamedTuple):
    """What a policy does next: fly level to a place and turn to a yaw; `over` ends the search."""

    place: tuple[float, float]
    yaw: float
    over: bool = False
    covered: float = 0.0


class Flight(NamedTuple):
    task: str
    shape: str
    around: str
    found: bool
    collided: bool
    steps: int
    flown_m: float
    shortest_m: float
    covered: float
    over: bool
    planning_s: tuple[float, ...]
    way: tuple[tuple[float, float], ...]
    in_view: tuple[bool, ...]
    """For each window of the target: had a stop it in view, by the truth?"""


Policy = Callable[[dict[int, DepthView], Pose], Move]


def contour(settings: ExplorerParameters) -> Policy:
    """The contour explorer, its memory between the steps."""
    memory: Memory | None = None

    def step(views: dict[int, DepthView], pose: Pose) -> Move:
        nonlocal memory
        done = explore(memory, tuple(views.values()), pose, settings)
        memory = done.memory
        decision = done.decision
        return Move(decision.place, decision.yaw, decision.status == "done", done.inspected_share)

    return step


def paper() -> Policy:
    """Eq. 4-7 with the corridor and the centre point; 30 degrees left where nothing is free."""
    d_max: float | None = None
    settings = usual.VIEWPOINT

    def step(views: dict[int, DepthView], pose: Pose) -> Move:
        nonlocal d_max
        means = {
            str(h): viewpoint.Sliced(
                h, viewpoint.slice_means(units(v.depth_m), 0.002, settings.slices, settings.sensor_range_m)
            )
            for h, v in views.items()
        }
        choice = viewpoint.choose_view(means, settings, d_max, np.random.default_rng(0))
        d_max = choice.d_max_next_m
        others = [views[h] for h in HEADINGS if h != choice.heading_deg]
        points = safe_distance.safe_distances(views[int(choice.heading_deg)], others, usual.SAFE_DISTANCE)
        centre = points[2]
        free = centre if centre.corridor.distance_m >= 1.0 else max(points, key=lambda p: p.corridor.distance_m)
        if free.corridor.distance_m < 1.0:
            return Move((pose.x, pose.y), pose.yaw + math.radians(30.0))
        reached = move_pose(pose, free.bearing_deg, free.corridor.distance_m)
        return Move((reached.x, reached.y), reached.yaw)

    return step


def fly(
    task: Task, policy: Policy, *, columns: int = 200, noise: float = 0.01, drift: float = 0.0, absent: bool = False
) -> Flight:
    """One search. `drift` is how far the believed position strays per metre flown, in a direction drawn once;
    `absent`: the window is never seen, so that the search ends by itself."""
    rng = np.random.default_rng(len(task.name) + int(1000 * task.shortest_m))
    astray = float(rng.uniform(0, math.tau))
    camera = pinhole(columns, max(8, columns // 8), 90.0)
    pose, flown = task.start, 0.0
    spent: list[float] = []
    covered, over, found, collided = 0.0, False, False, False
    way = [(pose.x, pose.y)]
    yaws = [pose.yaw]
    steps = 0
    while steps < MAX_STEPS and not (found or over or collided):
        steps += 1
        if not absent and sees_window(task, pose):
            found = True
            break
        seen = look(task, pose, camera, rng, noise)
        off = (flown * drift * math.cos(astray), flown * drift * math.sin(astray))
        believed = pose._replace(x=pose.x + off[0], y=pose.y + off[1])
        began = time.process_time()
        move = policy(seen, believed)
        spent.append(time.process_time() - began)
        covered, over = move.covered, move.over
        goal = np.array((move.place[0] - off[0], move.place[1] - off[1], pose.z))
        leg = np.stack((np.array(pose[:3]), goal))
        length = float(np.hypot(*(leg[1] - leg[0])[:2]))
        if length > 0.01:
            collided = nearest_m(task, leg) < RADIUS_M
            flown += length
        pose = Pose(float(goal[0]), float(goal[1]), pose.z, move.yaw)
        way.append((pose.x, pose.y))
        yaws.append(pose.yaw)
    rest = task.graph.route((pose.x, pose.y), before(task.window, task.normal))
    total = flown + (0.0 if isinstance(rest, NoWay) or not found else rest.length_m)
    return Flight(
        task.name, task.shape, task.around, found, collided, steps, total, task.shortest_m, covered, over, tuple(spent),
        tuple(way), tuple(in_view(task.windows, np.array(way), np.array(yaws), task.sight)),
    )  # fmt: skip


def figures(flights: Sequence[Flight]) -> dict[str, Any]:
    """The table's row."""
    found = [f for f in flights if f.found]
    spent: NDArray[np.float64] = np.array([s for f in flights for s in f.planning_s] or [0.0]) * 1e3
    return {
        "success": str(share(f.found for f in flights)),
        "by_around": {a: str(share(f.found for f in flights if f.around == a)) for a in AROUND},
        "by_shape": {s: str(share(f.found for f in flights if f.shape == s)) for s in SHAPES},
        "spl": spl([Flown(f.found, f.shortest_m, f.flown_m) for f in flights]),
        "steps": float(np.mean([f.steps for f in found])) if found else None,
        "way_m": float(np.mean([f.flown_m for f in flights])) if flights else None,
        "stops": float(np.mean([f.steps for f in flights])) if flights else None,
        "windows": str(share(seen for f in flights for seen in f.in_view)),
        "missed": {f.task: sum(not seen for seen in f.in_view) for f in flights if f.over and not all(f.in_view)},
        "collisions": sum(f.collided for f in flights),
        "covered": float(np.mean([f.covered for f in flights])) if flights else None,
        "ended": sum(f.over for f in flights),
        "planning_ms": {f"p{q}": round(float(np.percentile(spent, q)), 1) for q in (50, 95, 100)},
        "failed": [f.task for f in flights if not f.found],
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--worlds", type=int, default=2, help="seeds per ground plan and surroundings")
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--columns", type=int, default=200, help="pixels across a view")
    parser.add_argument("--noise", type=float, default=0.01, help="relative range noise")
    parser.add_argument("--drift", type=float, default=0.0, help="relative odometry drift")
    parser.add_argument("--balconies", action="store_true")
    parser.add_argument("--absent", action="store_true", help="the window is never seen")
    parser.add_argument("--policies", default="contour,paper")
    parser.add_argument("--tasks", help="a task set or file, in place of drawn worlds; every `--every`-th of it")
    parser.add_argument("--every", type=int, default=10)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    tasks = (
        [from_scene(task) for task in load(options.tasks).tasks[:: options.every]]
        if options.tasks
        else [
            make_task(shape, around, options.first_seed + k, options.balconies)
            for k in range(options.worlds)
            for shape in SHAPES
            for around in AROUND
        ]
    )
    made: dict[str, Callable[[], Policy]] = {"contour": lambda: contour(usual.EXPLORER), "paper": paper}
    rows = {}
    for name in options.policies.split(","):
        flights = [
            fly(
                task,
                made[name](),
                columns=options.columns,
                noise=options.noise,
                drift=options.drift,
                absent=options.absent,
            )
            for task in tasks
        ]
        rows[name] = figures(flights)
    told = {"tasks": len(tasks), "ideal_spl": float(np.mean([ideal_share(t) for t in tasks])), "policies": rows}
    if options.json:
        sys.stdout.write(json.dumps(told) + "\n")
        return
    sys.stdout.write(f"{len(tasks)} tasks, ideal SPL {told['ideal_spl']:.3f}\n")
    for name, row in rows.items():
        sys.stdout.write(f"{name:8} " + json.dumps(row, indent=None) + "\n")


if __name__ == "__main__":
    main()
