"""Where people or cars were seen to move, a search goes on above them."""

from mission.passing import OVER_M
from mission.places import above
from mission.step import Step


def rises_over_heads(step: Step) -> bool:
    """Plans the way up, straight; not where that is not free, was refused just now, or was flown just now."""
    vehicle, pose, state = step.drone.vehicle, step.pose, step.state
    low = vehicle.memory.passers_by and pose.z < vehicle.low_m
    if not low or state.refusals or state.looking is not None or step.just_rose or not vehicle.can_rise:
        return False
    step.plan_flight((above(pose, vehicle.low_m + OVER_M),), pose.yaw, "people or cars move here: on above them")
    step.update(rose_at=step.flown.moves + 1)
    return True
