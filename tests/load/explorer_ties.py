"""What a tie-breaker could win: `python -m tests.load.explorer_ties --worlds 1 --within 0.2`.

A tie is a step at which another place scores within `--within` of the best (gain / price) and shows nothing of what
the best one shows: two stretches of facade, either of which may hold the window. Each search is flown as the explorer
decides, then once more for each of its first ties with the other place taken there and everything after left to the
explorer. The best of them is what somebody would have flown who knows the outcome, their mean what a coin would.
"""

import argparse
import json
import sys
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evaluation.metrics.spl import Flown, spl
from evaluation.task_set.task_files import load
from navigation.explorer import goal
from navigation.explorer.explore import Memory, explore
from tests.load.explorer_study import Flight, Move, Policy, fly
from tests.navigation import usual
from tests.navigation.explorer_worlds import AROUND, SHAPES, Task, make_task
from tests.navigation.scene_worlds import from_scene

MOST_TIES = 3


class Asked(NamedTuple):
    """One step's choice: the best place's score, and the best score of a place that shows another piece."""

    best: float
    other: float


class Chooser:
    """Stands in for the explorer's last step of choosing; `deviate`: the step at which the other place is taken."""

    def __init__(self, deviate: int | None) -> None:
        self.deviate = deviate
        self.step = 0
        self.asked: dict[int, Asked] = {}

    def __call__(self, score: NDArray[np.float64], free: NDArray[np.float64], seen: NDArray[np.bool_]) -> int:
        best = int(score.argmax())
        apart = ~(seen & seen[best]).any(axis=1)
        other = int(np.where(apart, free, -1.0).argmax())
        self.asked.setdefault(self.step, Asked(float(score[best]), float(free[other]) if apart.any() else 0.0))
        return other if self.deviate == self.step and apart.any() else best


def policy(chooser: Chooser) -> Policy:
    memory: Memory | None = None

    def step(views: Any, pose: Any) -> Move:
        nonlocal memory
        goal.pick = chooser
        chooser.step += 1
        done = explore(memory, tuple(views.values()), pose, usual.EXPLORER)
        memory = done.memory
        decision = done.decision
        return Move(decision.place, decision.yaw, decision.status == "done", done.inspected_share)

    return step


def study(tasks: list[Task], within: float) -> dict[str, Any]:
    """Both searches of every tie, and what the better and the mean of them would have made of the whole."""
    plain: list[Flight] = []
    better: list[Flight] = []
    coin: list[tuple[float, float]] = []
    steps = ties = first_steps = tied_searches = 0
    for task in tasks:
        chooser = Chooser(None)
        first = fly(task, policy(chooser))
        tied = [k for k, asked in chooser.asked.items() if asked.other >= (1.0 - within) * asked.best > 0.0]
        steps, ties = steps + len(chooser.asked), ties + len(tied)
        tied_searches += bool(tied)
        first_steps += 1 in tied
        others = [fly(task, policy(Chooser(k))) for k in tied[:MOST_TIES]]
        options = [first, *others]
        plain.append(first)
        better.append(min(options, key=lambda f: (not f.found, f.flown_m)))
        worth = [spl([Flown(f.found, f.shortest_m, f.flown_m)]) or 0.0 for f in options]
        coin.append((float(np.mean(worth)), float(np.mean([f.steps for f in options]))))
        sys.stderr.write(f"{task.name}: {len(tied)} ties, {[round(f.flown_m, 1) for f in options]} m\n")
    return {
        "tasks": len(tasks),
        "choices": steps,
        "ties": ties,
        "ties_at_the_first_step": first_steps,
        "searches_with_a_tie": tied_searches,
        "searches_bettered": sum(p is not b for p, b in zip(plain, better, strict=True)),
        "plain": _figures(plain),
        "all_knowing": _figures(better),
        "coin": {"spl": float(np.mean([c[0] for c in coin])), "steps": float(np.mean([c[1] for c in coin]))},
    }


def _figures(flights: list[Flight]) -> dict[str, Any]:
    return {
        "found": sum(f.found for f in flights),
        "spl": spl([Flown(f.found, f.shortest_m, f.flown_m) for f in flights]),
        "steps": float(np.mean([f.steps for f in flights])),
        "way_m": float(np.mean([f.flown_m for f in flights])),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--worlds", type=int, default=1, help="seeds per ground plan and surroundings")
    parser.add_argument("--tasks", help="a task set or file, in place of drawn worlds; every `--every`-th of it")
    parser.add_argument("--every", type=int, default=20)
    parser.add_argument("--within", type=float, default=0.2, help="how near two scores are a tie, relative")
    options = parser.parse_args()
    if options.tasks:
        tasks = [from_scene(task) for task in load(options.tasks).tasks[:: options.every]]
    else:
        tasks = [make_task(s, a, k) for k in range(options.worlds) for s in SHAPES for a in AROUND]
    sys.stdout.write(json.dumps(study(tasks, options.within)) + "\n")


if __name__ == "__main__":
    main()
