"""At the final height: is a row of windows there, and is it that of the floor asked for? Where the picture says that it
is another's, the drone goes to the row that it says is meant, and counts once more there. Two of three counts decide.
"""

from contracts.event_data import HeightCheckData
from mission.looks import Sight
from mission.stage_actions.floor_counts import Count, count_floors, eq3_settings, window_rows
from mission.stages import BoxBuilding, Climb, ConfirmHeight
from mission.step import Step
from navigation.height_check import HeightCheck, check_height

MISPLACED_FLOORS = 0.3
"""A row that is so far off the drone's height is flown to."""


async def confirm_height(step: Step, stage: ConfirmHeight) -> Climb | BoxBuilding:
    """Raises PortError."""
    sight = await step.look_ahead()
    count = await count_floors(step, sight, stage.stand_off_m)
    floor, floor_height_m = step.state.floor or 1, step.state.floor_height_m or 3.0
    seen = window_rows(sight, count.rows, 0.5, stage.stand_off_m) if count.rows else None
    found = None if seen is None else check_height(seen, floor, floor_height_m)
    step.update(height_confirmed=found.confirms(floor) if found is not None else None)
    _write(step, sight, count, found)
    if found is None:
        return BoxBuilding()
    if step.state.height_confirmed and found.row_m is not None:
        if abs(found.row_m - step.pose.z) <= MISPLACED_FLOORS * floor_height_m:
            return BoxBuilding()
        return _to(step, found.row_m, "level with the row of windows", BoxBuilding())
    if stage.counted_m is not None:
        return _to(step, stage.counted_m, "back to the height that was counted first", BoxBuilding())
    if found.wanted_m is None:
        return BoxBuilding()
    again = ConfirmHeight(stand_off_m=stage.stand_off_m, counted_m=step.state.final_height_m)
    return _to(step, found.wanted_m, f"to what looks like floor {floor} from here", again)


def _to(step: Step, height_m: float, why: str, then: ConfirmHeight | BoxBuilding) -> Climb:
    height_m = max(height_m, eq3_settings(step).min_height_m)
    step.update(final_height_m=height_m)
    return Climb(to_m=height_m, why=why, then=then)


def _write(step: Step, sight: Sight, count: Count, found: HeightCheck | None) -> None:
    floor = step.state.floor
    if found is None:
        said = "the answer tells no rows of windows; the height stays as counted"
    elif step.state.height_confirmed:
        said = f"the windows ahead are floor {floor}'s" if found.floor else "a row of windows is ahead, as counted"
    elif found.floor is not None:
        said = f"the windows ahead look like floor {found.floor}'s, not floor {floor}'s"
    else:
        said = "no row of windows is level with the drone"
    step.write(
        f"height check: {said}",
        HeightCheckData(
            pose=sight.pose,
            floor_wanted=floor,
            floor_seen=found.floor if found is not None else None,
            row_m=round(found.row_m, 3) if found is not None and found.row_m is not None else None,
            confirmed=step.state.height_confirmed,
            answer=count.answer,
            seconds=round(count.seconds, 4),
        ),
        lambda: {sight.name: sight.jpeg},
    )
