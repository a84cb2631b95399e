"""Straight up or down along the facade, and once more from a little farther off where that way is not free."""

from mission.places import above, ahead
from mission.stages import AfterClimb, CheckClimb, Climb
from mission.step import MissionEnd, Step

BACK_OFF_M = 1.0
CLOSE_ENOUGH_M = 0.05


async def climb(step: Step, stage: Climb) -> CheckClimb | AfterClimb:
    """Plans the flight, the nose kept."""
    pose = step.pose
    if abs(pose.z - stage.to_m) < CLOSE_ENOUGH_M:
        return stage.then
    step.plan_flight((above(pose, stage.to_m),), pose.yaw, stage.why)
    return CheckClimb(to_m=stage.to_m, why=stage.why, then=stage.then, attempt=stage.attempt)


async def check_climb(step: Step, stage: CheckClimb) -> Climb | AfterClimb:
    """Raises MissionEnd (blocked) where neither attempt came through."""
    if step.state.arrived:
        return stage.then
    pose = step.pose
    if stage.attempt == "from_farther_off":
        raise MissionEnd("blocked", f"the way to {stage.to_m:.1f} m height is not free above {pose.z:.1f} m")
    step.plan_flight((ahead(pose, 180.0, BACK_OFF_M),), pose.yaw, "a little farther off the facade")
    return Climb(to_m=stage.to_m, why=stage.why, then=stage.then, attempt="from_farther_off")
