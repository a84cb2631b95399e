"""Floor localization: count the floors band by band, climb by eq. 3, and take the building's box at the final height.

`stepwise` is the paper's way. `direct-count` is its ablation: one picture of the whole building from farther away.
"""

import math
from typing import NamedTuple

from contracts.depth_assist import SafeDistancesQuestion
from contracts.event_data import (
    BandDecision,
    BuildingBoxData,
    FacadeBand,
    FinalHeightDecision,
    FloorCountData,
    FloorDecision,
    FloorDecisionName,
    FloorNotFoundDecision,
    StandOffData,
)
from contracts.geometry import Point3, Pose
from contracts.images import encode_jpeg, jpeg_bytes
from contracts.vehicle import MoveResult
from contracts.vlm_gateway import BuildingBoxQuestion, FloorCountAnswer, FloorCountQuestion
from mission.asking import Answered
from mission.marks import mark_box
from mission.sortie import MissionEnd, Sight, Sortie, above, ahead
from mission.wording import counted
from navigation import facade
from navigation.floor_localization import (
    Band,
    Climb,
    FinalHeight,
    FloorNotFound,
    Recount,
    Settings,
    VerticalView,
    WindowRows,
    band,
    band_span_m,
    corrected,
    decide,
    direct_count,
    rows_of_band,
)

FACADE = facade.Settings()
NUDGE_RAD = math.radians(4)
DRIFT_M = 0.5
BACK_OFF_M = 1.0
STEP_BACK_M = 12.0
STEPS_BACK = 3


class Count(NamedTuple):
    """The floors in one picture, null where the model's answer said nothing; and their window rows, 0..1 from the top,
    where the model tells one for each of them."""

    floors: int | None
    rows: tuple[float, ...] | None
    answer: FloorCountAnswer
    seconds: float


async def go_to_floor(sortie: Sortie) -> None:
    """Climbs to the middle of the floor that was asked for. Raises MissionEnd (floor_not_found, answer_unreadable,
    blocked, collision), PortError."""
    sortie.enter("floors", f"going to floor {sortie.floor}")
    sight = await _front(sortie)
    stand_off = facade.stand_off_m(sight.seen, FACADE)
    if stand_off is None:
        raise MissionEnd("floor_not_found", "depth shows no facade ahead of the drone, so no floor can be counted")
    view = _vertical(sight)
    span = band_span_m(stand_off, view)
    sortie.write(
        f"the facade is {stand_off:.1f} m ahead: one picture spans {span:.1f} m of it",
        StandOffData(stand_off_m=round(stand_off, 3), span_m=round(span, 3), pose=sight.pose),
        lambda: {sight.name: sight.jpeg},
    )
    if sortie.settings.floors == "direct-count":
        final = await _direct(sortie, stand_off)
    else:
        final = await _stepwise(sortie, stand_off, band(1, span, view.camera_at))
    sortie.final_height_m, sortie.floor_height_m = final.height_m, final.floor_height_m
    await _rise(sortie, final.height_m, f"to floor {sortie.floor} at {final.height_m:.1f} m")
    await _building_box(sortie)


async def _stepwise(sortie: Sortie, stand_off: float, here: Band) -> FinalHeight:
    """Band after band until eq. 3 gives the height."""
    floors_below, silent = 0.0, 0
    below: WindowRows | None = None
    for _ in range(sortie.settings.max_bands + sortie.settings.max_model_failures):
        await _rise(sortie, here.camera_m, f"to the middle of band {here.number}")
        sight = await _front(sortie)
        top = facade.facade_top_m(sight.seen, stand_off, sight.pose.z, FACADE)
        sight = await _hold(sortie, sight, stand_off, top)
        count = _across_edge(await _count(sortie, sight), sight, here, below, stand_off)
        decision = decide(here, floors_below, count.floors, sortie.floor or 1, top, _eq3(sortie))
        if isinstance(decision, FinalHeight):
            decision = _held_against_rows(sortie, decision, sight, count, stand_off)
        _report(sortie, sight, count, here, top, decision)
        match decision:
            case FinalHeight():
                return decision
            case Climb():
                below = _window_rows(sight, count, 0, stand_off)
                here, floors_below = decision.band, decision.floors_counted
                if here.number > sortie.settings.max_bands:
                    break
            case Recount():
                silent += 1
                if silent > sortie.settings.max_model_failures:
                    raise _useless(silent, count)
                # another picture of the same band, or a deterministic model would only repeat itself
                await sortie.fly((), sight.pose.yaw + NUDGE_RAD * (-1) ** silent, "a slightly different look")
            case FloorNotFound():
                raise _not_there(sortie, decision)
    raise MissionEnd("floor_not_found", f"floor {sortie.floor} is not within {sortie.settings.max_bands} bands")


def _held_against_rows(sortie: Sortie, final: FinalHeight, sight: Sight, count: Count, stand_off: float) -> FinalHeight:
    """Where the model says at which heights of the picture it saw its floors, they have the last word."""
    at = round(final.floors_counted) - (sortie.floor or 1)
    seen = _window_rows(sight, count, at, stand_off)
    return corrected(final, sortie.floor or 1, seen, _eq3(sortie)) if seen is not None else final


def _across_edge(count: Count, sight: Sight, here: Band, below: WindowRows | None, stand_off: float) -> Count:
    """The count without a floor that the band below had counted, with one that neither saw, or down to the ground with
    those that something hides."""
    seen = _window_rows(sight, count, -1, stand_off)
    if seen is None:
        return count
    rows = rows_of_band(seen, below, here)
    return count._replace(floors=len(rows), rows=rows)


def _window_rows(sight: Sight, count: Count, at: int, stand_off: float) -> WindowRows | None:
    """The rows of a count, on the wall as far off as it is at row number `at`; null where there are none."""
    if not count.rows:
        return None
    row = count.rows[at] if -1 <= at < len(count.rows) else 0.5
    wall_m = facade.wall_at_row_m(sight.seen, row, stand_off, FACADE)
    return WindowRows(count.rows, sight.pose.z, wall_m, _vertical(sight))


async def _direct(sortie: Sortie, stand_off: float) -> FinalHeight:
    """The ablation: away from the facade until its top is in sight, then one count of all floors."""
    home = sortie.flown.pose
    left = len(sortie.ends)
    top: float | None = None
    sight = await _front(sortie)
    for _ in range(STEPS_BACK):
        await _back(sortie)
        away = stand_off + math.hypot(sortie.flown.pose.x - home.x, sortie.flown.pose.y - home.y)
        await _rise(sortie, away, "to see the whole building")
        sight = await _front(sortie)
        top = facade.facade_top_m(sight.seen, away, sight.pose.z, FACADE)
        if top is not None:
            break
    for silent in range(sortie.settings.max_model_failures + 1):
        count = await _count(sortie, sight)
        seen_m = top if top is not None else sight.pose.z + away
        decision = direct_count(count.floors, seen_m, sortie.floor or 1, _eq3(sortie))
        _report(sortie, sight, count, None, top, decision)
        if isinstance(decision, FloorNotFound):
            raise _not_there(sortie, decision)
        if isinstance(decision, FinalHeight):
            # what lies beneath or between is not known: back the way it came, which was free
            await sortie.fly(_retraced([home, *sortie.ends[left:]]), home.yaw, "back to the facade")
            await _rise(sortie, decision.height_m, f"to floor {sortie.floor}")
            return decision
        await sortie.fly((), sight.pose.yaw + NUDGE_RAD * (-1) ** silent, "a slightly different look")
        sight = await _front(sortie)
    raise _useless(sortie.settings.max_model_failures + 1, count)


def _retraced(way: list[Pose]) -> tuple[Point3, ...]:
    """From the last place of `way` back along it, to where it left the column over its first."""
    first = way[0]
    apart = [math.hypot(p.x - first.x, p.y - first.y) > 0.05 for p in way]
    last_home = apart.index(True) - 1 if any(apart) else len(way) - 1
    places = (Point3(x=p.x, y=p.y, z=p.z) for p in reversed(way[last_home:-1]))
    return tuple(dict.fromkeys(places))  # without the turns


async def _back(sortie: Sortie) -> None:
    """Turns round, looks how far the way is free, flies it, and turns back to the building."""
    facing = sortie.flown.pose.yaw
    await sortie.fly((), facing + math.pi, "turn round")
    behind = await sortie.look((-45, 0, 45))
    settings = sortie.settings.safe_distances.model_copy(update={"l_max_m": STEP_BACK_M})
    sight = behind.sights[0]
    question = SafeDistancesQuestion(view=sight.depth_view, others=behind.depth_beside(sight), settings=settings)
    safe = await sortie.timed("safe_distances", sortie.ports.depth.safe_distances(question))
    free = next((p.distance_m for p in safe.points if p.label == "c"), 0.0)
    path = (ahead(sortie.flown.pose, 0.0, free),) if free >= sortie.settings.min_move_m else ()
    await sortie.fly(path, facing, f"{free:.1f} m away from the building")


async def _rise(sortie: Sortie, z: float, why: str) -> MoveResult | None:
    """Straight up or down, nose kept. A way that is not free is tried once more from a little farther off the facade.
    Raises MissionEnd (blocked, collision), PortError."""
    pose = sortie.flown.pose
    if abs(pose.z - z) < 0.05:
        return None
    done = await sortie.fly((above(pose, z),), pose.yaw, why)
    if done.reached:
        return done
    off = ahead(done.pose, 180.0, BACK_OFF_M)
    await sortie.fly((off,), pose.yaw, "a little farther off the facade")
    done = await sortie.fly((above(sortie.flown.pose, z),), pose.yaw, why)
    if not done.reached:
        raise MissionEnd("blocked", f"the way to {z:.1f} m height is not free above {done.pose.z:.1f} m")
    return done


async def _hold(sortie: Sortie, sight: Sight, stand_off: float, top: float | None) -> Sight:
    """Follows a facade that steps back as it rises, so that bands keep touching; only where no roof is in sight."""
    now = facade.stand_off_m(sight.seen, FACADE)
    if top is not None or now is None or not DRIFT_M < now - stand_off <= FACADE.recess_m:
        return sight
    await sortie.fly((ahead(sight.pose, 0.0, now - stand_off),), sight.pose.yaw, "following the facade")
    return await _front(sortie)


async def _front(sortie: Sortie) -> Sight:
    return (await sortie.look((0,))).sights[0]


async def _count(sortie: Sortie, sight: Sight) -> Count:
    sortie.count_stop()
    question = FloorCountQuestion(
        model=sortie.settings.vision_model, oracle_episode=sortie.flown.id, image=sight.view.image
    )
    reply = await sortie.book.ask("floors", sortie.ports.vision.floor_count(question))
    floors, rows = (reply.answer.floors, reply.answer.rows) if isinstance(reply, Answered) else (None, None)
    return Count(floors, rows if rows is not None and len(rows) == floors else None, reply.answer, reply.seconds)


async def _building_box(sortie: Sortie) -> None:
    """Taken once, at the final height; without a usable answer the depth images are simply not cropped."""
    sight = await _front(sortie)
    sortie.count_stop()
    question = BuildingBoxQuestion(
        model=sortie.settings.vision_model, oracle_episode=sortie.flown.id, image=sight.view.image
    )
    reply = await sortie.book.ask("floors", sortie.ports.vision.building_box(question))
    box = reply.answer.box if isinstance(reply, Answered) else None
    sortie.building_box = box
    said = "the building's box" if box else f"no building box ({reply.answer.outcome}); depth stays uncropped"
    sortie.write(
        said,
        BuildingBoxData(pose=sight.pose, answer=reply.answer, seconds=round(reply.seconds, 4)),
        lambda: {sight.name: jpeg_bytes(encode_jpeg(mark_box(sight.rgb, box, "building"))) if box else sight.jpeg},
    )


def _vertical(sight: Sight) -> VerticalView:
    return VerticalView(sight.camera.up_slope, sight.camera.down_slope)


def _eq3(sortie: Sortie) -> Settings:
    return Settings(reading=sortie.settings.band_reading)


def _report(
    sortie: Sortie,
    sight: Sight,
    count: Count,
    here: Band | None,
    top: float | None,
    decision: Climb | FinalHeight | Recount | FloorNotFound | None,
) -> None:
    place = f"band {here.number}" if here else "the whole building"
    said = counted(count.floors, "floor") if count.floors is not None else f"the answer was {count.answer.outcome}"
    if count.floors is not None and count.answer.floors is not None and count.floors != count.answer.floors:
        once_more = count.floors < count.answer.floors
        said += " (without one counted below)" if once_more else " (with what the picture does not show)"
    decided = _decided(decision)
    sortie.write(
        f"{place}: {said}; {decided.words}",
        FloorCountData(
            pose=sight.pose,
            band=_recorded(here),
            facade_top_m=round(top, 3) if top is not None else None,
            floors_new=count.floors,
            floors_wanted=sortie.floor,
            answer=count.answer,
            decision=decided.name,
            detail=decided.detail,
            seconds=round(count.seconds, 4),
        ),
        lambda: {sight.name: sight.jpeg},
    )


class Decided(NamedTuple):
    """A decision as the record has it, and in words."""

    name: FloorDecisionName
    detail: FloorDecision
    words: str


def _decided(decision: Climb | FinalHeight | Recount | FloorNotFound | None) -> Decided:
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


def _not_there(sortie: Sortie, end: FloorNotFound) -> MissionEnd:
    return MissionEnd(
        "floor_not_found",
        f"{end.floors_counted:g} floors were counted up to the facade's top at {end.facade_top_m:.1f} m; "
        f"there is no floor {sortie.floor}",
    )


def _useless(times: int, count: Count) -> MissionEnd:
    return MissionEnd(
        "answer_unreadable", f"the floor count was {count.answer.outcome} {times} times; no height can be found"
    )
