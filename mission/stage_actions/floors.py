"""Floor localization: count the floors band by band, climb by eq. 3, and take the building's box at the final height.

This is the paper's way, `stepwise`; its ablation `direct-count` is in `mission.stage_actions.direct_count`.
"""

from contracts.event_data import BuildingBoxData, StandOffData
from contracts.images import encode_jpeg, jpeg_bytes
from contracts.vlm_gateway import BuildingBoxQuestion
from mission.annotation import mark_box
from mission.looks import Sight
from mission.model_calls import Answered
from mission.places import ahead
from mission.stage_actions.climbing import once_more_from_below
from mission.stage_actions.direct_count import leave_facade, no_such_floor
from mission.stage_actions.floor_counts import (
    FACADE,
    Count,
    count_floors,
    eq3_settings,
    turn_a_little,
    useless,
    vertical,
    window_rows,
    write_count,
)
from mission.stages import (
    BackOff,
    BandCount,
    Climb,
    ConfirmHeight,
    CountBand,
    CountBandFromNearer,
    LookRound,
    TakeStand,
)
from mission.step import MissionEnd, Step
from navigation import facade, floor_localization
from navigation.floor_localization import (
    LEAST_FLOOR_M,
    TALLEST_FLOOR_M,
    FinalHeight,
    FloorNotFound,
    Recount,
    WindowRows,
    band,
    band_span_m,
)

DRIFT_M = 0.5
LOOKS_FOR_FACADE = 3


async def measure_stand_off(step: Step) -> Climb | BackOff:
    """How far the facade is ahead. Raises MissionEnd (floor_not_found) where depth shows none; PortError."""
    step.enter("floors", f"going to floor {step.state.floor}")
    sight, stand_off = await _facade_ahead(step)
    if stand_off is None:
        raise MissionEnd("floor_not_found", "depth shows no facade ahead of the drone, so no floor can be counted")
    view = vertical(sight)
    span = band_span_m(stand_off, view)
    step.write(
        f"the facade is {stand_off:.1f} m ahead: one picture spans {span:.1f} m of it",
        StandOffData(stand_off_m=round(stand_off, 3), span_m=round(span, 3), pose=sight.pose),
        lambda: {sight.name: sight.jpeg},
    )
    if step.settings.floors == "direct-count":
        return leave_facade(step, stand_off)
    return _climb_to(step, CountBand(stand_off_m=stand_off, band=band(1, span, view.camera_at)))


async def _facade_ahead(step: Step) -> tuple[Sight, float | None]:
    """Looked for again where there is none: of a real camera's frames now and then only a part arrives."""
    for _ in range(LOOKS_FOR_FACADE):
        sight = await step.look_ahead()
        stand_off = facade.stand_off_m(sight.seen, FACADE)
        if stand_off is not None:
            break
    return sight, stand_off


async def count_band(step: Step, stage: CountBand) -> Climb | CountBand | CountBandFromNearer | TakeStand:
    """Raises MissionEnd: floor_not_found, answer_unreadable; PortError."""
    sight = await step.look_ahead()
    top = facade.facade_top_m(sight.seen, stage.stand_off_m, sight.eye_z, FACADE)
    now = facade.stand_off_m(sight.seen, FACADE)
    steps_back = now is not None and DRIFT_M < now - stage.stand_off_m <= FACADE.recess_m
    if top is None and now is not None and steps_back:
        # a facade that steps back as it rises is followed, so that bands keep touching
        step.plan_flight((ahead(sight.pose, 0.0, now - stage.stand_off_m),), sight.pose.yaw, "following the facade")
        return CountBandFromNearer.model_validate(stage.model_dump(exclude={"at"}))
    return await _decide(step, stage, sight, top)


async def count_band_from_nearer(step: Step, stage: CountBandFromNearer) -> Climb | CountBand | TakeStand:
    """No roof was in sight from farther off. Raises as `count_band`."""
    return await _decide(step, stage, await step.look_ahead(), None)


async def _decide(step: Step, stage: BandCount, sight: Sight, top: float | None) -> Climb | CountBand | TakeStand:
    """Eq. 3 after one band: the final height, the next band, or the same once more."""
    count = _across_edge(await count_floors(step, sight, stage.stand_off_m), sight, stage)
    decision = floor_localization.decide(
        stage.band, stage.floors_below, count.floors, step.state.floor or 1, top, eq3_settings(step)
    )
    if isinstance(decision, FinalHeight):
        decision = _held_against_rows(step, decision, sight, count, stage.stand_off_m)
    write_count(step, sight, count, stage.band, top, decision)
    match decision:
        case FinalHeight():
            return _to_final_height(step, decision, stage.stand_off_m)
        case FloorNotFound():
            if _seen_amiss(stage, sight, decision):
                return once_more_from_below(step, stage.stand_off_m, decision.facade_top_m, top_seen=True)
            return no_such_floor(step, decision)
        case Recount():
            silent = stage.silent + 1
            if silent > step.settings.max_model_failures:
                raise useless(silent, count)
            turn_a_little(step, silent)
            return CountBand.model_validate(stage.model_dump(exclude={"at", "silent"}) | {"silent": silent})
        case floor_localization.Climb():
            if decision.band.number > step.settings.max_bands:
                end = f"floor {step.state.floor} is not within {step.settings.max_bands} bands"
                raise MissionEnd("floor_not_found", end)
            return _climb_to(
                step,
                CountBand(
                    stand_off_m=stage.stand_off_m,
                    band=decision.band,
                    floors_below=decision.floors_counted,
                    rows_below=_window_rows(sight, count, 0, stage.stand_off_m),
                    silent=stage.silent,
                ),
            )


def _seen_amiss(stage: BandCount, sight: Sight, end: FloorNotFound) -> bool:
    """May a look from half the facade's height, which shows a band of it, count more? The whole of a facade that ends
    in the first band; windows under the eaves, which a camera above the roof does not see; what was missed where the
    floors that were counted would be taller than floors are."""
    if end.facade_top_m > stage.band.upper_m - stage.band.lower_m:
        return False
    if end.floors_counted == 0:
        return end.facade_top_m < sight.eye_z
    return stage.band.number == 1 or end.facade_top_m > TALLEST_FLOOR_M * end.floors_counted


def _to_final_height(step: Step, final: FinalHeight, stand_off_m: float) -> Climb:
    """The climb to the middle of the floor that was asked for."""
    step.update(final_height_m=final.height_m, floor_height_m=max(final.floor_height_m, LEAST_FLOOR_M))
    why = f"to floor {step.state.floor} at {final.height_m:.1f} m"
    return Climb(to_m=final.height_m, why=why, then=ConfirmHeight(stand_off_m=stand_off_m))


async def box_building(step: Step) -> LookRound:
    """Taken once, at the final height; without a usable answer the depth images are simply not cropped. Raises
    PortError."""
    sight = await step.look_ahead()
    step.count_stop()
    question = BuildingBoxQuestion(
        model=step.settings.vision_model,
        image=sight.view.image,
        camera=sight.view.camera,
    )
    reply = await step.ask("floors", step.ports.vision.building_box(question))
    box = reply.answer.box if isinstance(reply, Answered) else None
    step.update(building_box=box)
    said = "the building's box" if box else f"no building box ({reply.answer.outcome}); depth stays uncropped"
    step.write(
        said,
        BuildingBoxData(pose=sight.pose, answer=reply.answer, seconds=round(reply.seconds, 4)),
        lambda: {sight.name: jpeg_bytes(encode_jpeg(mark_box(sight.rgb, box, "building"))) if box else sight.jpeg},
    )
    return LookRound()


def _climb_to(step: Step, stage: CountBand) -> Climb:
    """To where the front camera stands at its place in the band."""
    return Climb(
        to_m=max(0.0, stage.band.camera_m - step.drone.front_up_m),
        why=f"to the middle of band {stage.band.number}",
        then=stage,
    )


def _held_against_rows(step: Step, final: FinalHeight, sight: Sight, count: Count, stand_off: float) -> FinalHeight:
    """Where the model says at which heights of the picture it saw its floors, they have the last word."""
    floor = step.state.floor or 1
    seen = _window_rows(sight, count, round(final.floors_counted) - floor, stand_off)
    return floor_localization.corrected(final, floor, seen, eq3_settings(step)) if seen is not None else final


def _across_edge(count: Count, sight: Sight, stage: BandCount) -> Count:
    """The count without the floors that the band below had counted, with one that neither saw, or down to the ground
    with those that something hides. A camera that must not rise to its place in the band sees part of the one below."""
    too_low_m = stage.band.camera_m - sight.eye_z
    if count.floors is None or (not count.rows and too_low_m <= DRIFT_M):
        return count
    seen = _window_rows(sight, count, -1, stage.stand_off_m)
    if seen is None:
        below = floor_localization.floors_seen_again(too_low_m, stage.band, stage.floors_below)
        return count._replace(floors=max(0, count.floors - below))
    if too_low_m > DRIFT_M:
        seen = floor_localization.rows_above(seen, stage.band.lower_m)
    rows = floor_localization.rows_of_band(seen, stage.rows_below, stage.band)
    return count._replace(floors=len(rows), rows=rows)


def _window_rows(sight: Sight, count: Count, at: int, stand_off: float) -> WindowRows | None:
    """The rows of a count, on the wall as far off as it is at row number `at`; null where there are none."""
    if not count.rows:
        return None
    return window_rows(sight, count.rows, count.rows[at] if -1 <= at < len(count.rows) else 0.5, stand_off)
