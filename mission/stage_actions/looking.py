"""Looks for which the cameras may not suffice: then the drone turns on the spot, and each turn is a stop of its own."""

import math

from mission.looks import Look, joined, navigation_camera, turns_needed
from mission.state import LookUnderWay
from mission.step import Step

ALL_ROUND_DEG = 135.0
"""How far to either side of the nose a search looks: what a facade flown along shows before and behind."""
AHEAD_DEG = 30.0
"""How far to either side an approach looks: the drone faces the thing."""


async def look_aside(step: Step, reach_deg: float, *, asks: bool = True) -> Look | None:
    """A look that sees everything up to `reach_deg` to either side of the nose. Null where the drone has to turn for
    it: the next stop's flight is that turn, and the same stage asks again there. `asks`: a model will be asked about
    it, so that each turn counts as a stop. Raises PortError."""
    drone = step.drone
    turns = turns_needed([navigation_camera(camera) for camera in drone.capabilities.cameras], reach_deg)
    if not turns:
        return await step.look()
    looking = step.state.looking
    if looking is None:
        _plan_turn(step, LookUnderWay(yaw=step.pose.yaw, turns_deg=turns))
        return None
    if asks:
        step.count_stop()
    left = looking.turns_deg[1:]
    # what looks up or down sees the same whichever way the nose points: once is enough
    seen = (*looking.seen, await step.observe(drone.level if left else drone.cameras))
    if left:
        _plan_turn(step, looking.model_copy(update={"turns_deg": left, "seen": seen}))
        return None
    step.update(looking=None)
    return joined(seen, drone.cameras)


def _plan_turn(step: Step, looking: LookUnderWay) -> None:
    towards = looking.turns_deg[0]
    step.update(looking=looking)
    side = "ahead again" if towards == 0 else f"{abs(towards):g}° {'right' if towards > 0 else 'left'}"
    step.plan_flight((), looking.yaw - math.radians(towards), f"turn to look round: {side}")
