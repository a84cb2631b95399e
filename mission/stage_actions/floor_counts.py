"""One floor count: the question, the answer, and what of both goes into the record."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from contracts.event_data import (
    BandDecision,
    FacadeBand,
    FinalHeightDecision,
    FloorCountData,
    FloorDecision,
    FloorDecisionName,
    FloorNotFoundDecision,
)
from contracts.images import JpegImage, encode_jpeg
from contracts.vlm_gateway import FloorCountAnswer, FloorCountQuestion
from mission.looks import Sight
from mission.model_calls import Answered
from mission.step import MissionEnd, Step
from mission.wording import counted
from navigation import facade
from navigation.floor_localization import (
    Band,
    Climb,
    FinalHeight,
    FloorLocalizationParameters,
    FloorNotFound,
    Recount,
    VerticalView,
    WindowRows,
)

FACADE = facade.FacadeParameters()
NUDGE_RAD = math.radians(4)
_BLANK = 200
"""The grey of a clouded sky."""

Decision = Climb | FinalHeight | Recount | FloorNotFound


class Count(NamedTuple):
    """The floors in one picture, null where the model's answer said nothing; and their window rows, 0..1 from the top,
    where the model tells one for each of them."""

    floors: int | None
    rows: tuple[float, ...] | None
    answer: FloorCountAnswer
    seconds: float


class Decided(NamedTuple):
    """A decision as the record has it, and in words."""

    name: FloorDecisionName
    detail: FloorDecision
    words: str


async def count_floors(step: Step, sight: Sight, stand_off_m: float | None = None) -> Count:
    """Asks for the floors in one picture. Where the rows of windows can't all be of the wall `stand_off_m` ahead, asks
    once more with nothing but that wall in the picture. Raises PortError."""
    step.count_stop()
    count = await _asked(step, sight, sight.view.image)
    if stand_off_m is None or _is_of_one_wall(count, sight, stand_off_m):
        return count
    columns = facade.wall_columns(sight.seen, stand_off_m)
    if columns is None:
        return count
    again = await _asked(step, sight, encode_jpeg(_alone(sight, columns)))
    return again if again.floors and _is_of_one_wall(again, sight, stand_off_m) else count


async def _asked(step: Step, sight: Sight, image: JpegImage) -> Count:
    question = FloorCountQuestion(model=step.settings.vision_model, image=image, camera=sight.view.camera)
    reply = await step.ask("floors", step.ports.vision.floor_count(question))
    floors, rows = (reply.answer.floors, reply.answer.rows) if isinstance(reply, Answered) else (None, None)
    return Count(floors, rows if rows is not None and len(rows) == floors else None, reply.answer, reply.seconds)


def _is_of_one_wall(count: Count, sight: Sight, stand_off_m: float) -> bool:
    return WindowRows(count.rows or (), sight.eye_z, stand_off_m, vertical(sight)).is_of_one_wall


def _alone(sight: Sight, columns: tuple[int, int]) -> NDArray[np.uint8]:
    """The picture with all but these columns painted over."""
    alone = np.full_like(sight.rgb, _BLANK)
    scale = sight.rgb.shape[1] / sight.camera.width
    shown = slice(round(columns[0] * scale), round(columns[1] * scale))
    alone[:, shown] = sight.rgb[:, shown]
    return alone


def vertical(sight: Sight) -> VerticalView:
    """What the picture shows of the facade upright."""
    return VerticalView(sight.camera.up_slope, sight.camera.down_slope)


def window_rows(sight: Sight, rows: tuple[float, ...], at: float, stand_off_m: float) -> WindowRows:
    """These rows of a picture, on the wall as far off as it is at the picture's row `at` (0..1 from the top)."""
    wall_m = facade.wall_at_row_m(sight.seen, at, stand_off_m, FACADE)
    return WindowRows(rows, sight.eye_z, wall_m, vertical(sight))


def eq3_settings(step: Step) -> FloorLocalizationParameters:
    return FloorLocalizationParameters(reading=step.settings.band_reading)


def turn_a_little(step: Step, silent: int) -> None:
    """Another picture of the same floors, or a deterministic model would only repeat itself."""
    step.plan_flight((), step.pose.yaw + NUDGE_RAD * (-1) ** silent, "a slightly different look")


def write_count(
    step: Step, sight: Sight, count: Count, here: Band | None, top_m: float | None, decision: Decision | None
) -> None:
    """The event of a count and what eq. 3 makes of it; `here` is null for a picture of the whole building."""
    place = f"band {here.number}" if here else "the whole building"
    said = counted(count.floors, "floor") if count.floors is not None else f"the answer was {count.answer.outcome}"
    if count.floors is not None and count.answer.floors is not None and count.floors != count.answer.floors:
        once_more = count.floors < count.answer.floors
        said += " (without one counted below)" if once_more else " (with what the picture does not show)"
    decided = _decided(decision)
    step.write(
        f"{place}: {said}; {decided.words}",
        FloorCountData(
            pose=sight.pose,
            band=_recorded(here),
            facade_top_m=round(top_m, 3) if top_m is not None else None,
            floors_new=count.floors,
            floors_wanted=step.state.floor,
            answer=count.answer,
            decision=decided.name,
            detail=decided.detail,
            seconds=round(count.seconds, 4),
        ),
        lambda: {sight.name: sight.jpeg},
    )


def not_there(step: Step, end: FloorNotFound) -> MissionEnd:
    return MissionEnd(
        "floor_not_found",
        f"{end.floors_counted:g} floors were counted up to the facade's top at {end.facade_top_m:.1f} m; "
        f"there is no floor {step.state.floor}",
    )


def useless(times: int, count: Count) -> MissionEnd:
    answer = count.answer
    words = f", in its words {' '.join(answer.text.split())[:100]!r}" if answer.text else ""
    return MissionEnd(
        "answer_unreadable",
        f"the floor count was {answer.outcome} {times} times by {answer.model}{words}; no height can be found",
    )


def _decided(decision: Decision | None) -> Decided:
    match decision:
        case FinalHeight():
            words = f"height found: {decision.height_m:.1f} m"
            return Decided("FinalHeight", FinalHeightDecision(**decision._asdict()), words)
        case FloorNotFound():
            return Decided("FloorNotFound", FloorNotFoundDecision(**decision._asdict()), "no such floor")
        case Climb():
            detail = BandDecision(band=_recorded(decision.band), floors_counted=decision.floors_counted)
            return Decided("Climb", detail, "climb on")
        case Recount():
            detail = BandDecision(band=_recorded(decision.band), floors_counted=decision.floors_counted)
            return Decided("Recount", detail, "ask again")
        case None:
            return Decided("Recount", BandDecision(band=None, floors_counted=0.0), "ask again")


def _recorded(band: Band | None) -> FacadeBand | None:
    return FacadeBand(**band._asdict()) if band is not None else None
