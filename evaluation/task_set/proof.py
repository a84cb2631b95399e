"""The proof that a delivery can be made: it is flown, with the truth, in the simulator that will judge it.

In still air, with perfect sensors and nobody about: the way is there, whatever a drone makes of it.
"""

import contextlib
import math
from typing import NamedTuple

from contracts.cameras import default_rig
from contracts.geometry import Point3, Pose
from contracts.scene import CALM, Scene
from contracts.scene_layout import WindowSlot
from contracts.sim import Claim, TruthQuestion, Verdict
from contracts.vehicle import Move
from evaluation.sim_client import SimClient, SimulatorFault
from evaluation.task_set.shortest import Edition, ShortestWay, goal_slot, ways

SEEN_SHARE = 0.4
SEEN_PIXELS = 80
"""What the oracle back end takes for seen."""
_LOOK_OFF_M = (6.0, 4.5, 9.0)


class NotSolvable(Exception):
    """The delivery can't be made as the scene stands; the message says where the proof failed."""


class Proof(NamedTuple):
    """`way` was flown without touching anything and ended in a place where the claim was judged delivered; from
    `seen_from` the oracle sees the object."""

    way: ShortestWay
    seen_from: Pose


def prove(scene: Scene, simulator: SimClient, edition: Edition) -> Proof:
    """Flies the shortest way, looks, and claims the window. Raises NotSolvable, SimulatorFault."""
    slot = goal_slot(scene)
    still = scene.model_copy(update={"air": CALM, "sensors": None, "traffic": ()})
    why = "no way on the plan leads to the window"
    for way in ways(scene, edition):
        try:
            return _flown(still, slot, way, simulator, edition)
        except NotSolvable as error:
            why = str(error)
    raise NotSolvable(f"{scene.name}: {why}")


def _flown(scene: Scene, slot: WindowSlot, way: ShortestWay, simulator: SimClient, edition: Edition) -> Proof:
    episode = simulator.open(scene)
    try:
        facing = math.atan2(-slot.normal[1], -slot.normal[0])
        done = simulator.move(episode.id, 1, Move(path=way.path, yaw=facing))
        if not done.reached:
            raise NotSolvable(f"with {way.clearance_m:g} m clearance the drone hits {done.hit}")
        stop, moves = done.pose, 1
        seen_from: Pose | None = None
        for off in _LOOK_OFF_M:
            x, y = (slot.centre[i] + slot.normal[i] * off for i in (0, 1))
            moves += 1
            there = simulator.move(episode.id, moves, Move(path=(Point3(x=x, y=y, z=stop.z),), yaw=facing))
            if not there.reached:
                raise NotSolvable(f"{off:g} m before the window the drone hits {there.hit}")
            if _seen(simulator, episode.id):
                seen_from = there.pose
                break
        if seen_from is None:
            raise NotSolvable("the object shows too little from before its window")
        moves += 1
        back = simulator.move(episode.id, moves, Move(path=(Point3(x=stop.x, y=stop.y, z=stop.z),), yaw=facing))
        x, y, z = slot.centre
        verdict = simulator.claim(episode.id, Claim(target=Point3(x=x, y=y, z=z)))
        if not (back.reached and _delivers(verdict, edition)):
            raise NotSolvable("the stop at the end of the shortest way is not a delivery")
        return Proof(way, seen_from)
    finally:
        with contextlib.suppress(SimulatorFault):
            simulator.close(episode.id)


def _delivers(verdict: Verdict, edition: Edition) -> bool:
    """By the judge's rules; the first edition was proved before the nearest window counted."""
    if edition.own_window:
        return verdict.delivered
    ruled = verdict.model_copy(update={"nearest_window": None, "aside_deg": None})
    return bool(verdict.right_window) and ruled.stops_well()


def _seen(simulator: SimClient, episode: str) -> bool:
    (view,) = simulator.truth(episode, TruthQuestion(cameras=(default_rig().camera("front"),))).views
    return any(o.goal and o.share >= SEEN_SHARE and o.pixels >= SEEN_PIXELS for o in view.objects)
