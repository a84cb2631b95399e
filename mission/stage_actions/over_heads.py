"""Where people or cars were seen to move, a search goes on above them."""

from mission.passing import OVER_M
from mission.places import above
from mission.step import Step


def rises_over_heads(step: Step) -> bool:
    """Plans the way up, straight; not where that is not free, or was refused just now."""
    vehicle, pose, state = step.drone.vehicle, step.pose, step.state
    over_m = vehicle.low_m + OVER_M
    low = vehicle.memory.passers_by and pose.z < vehicle.low_m
    if not low or state.refusals or state.looking is not None:
        return False
    if not vehicle.can_rise:
        return False
    step.plan_flight((above(pose, over_m),), pose.yaw, "people or cars move here: on above them")
    return True
