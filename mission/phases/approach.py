"""The approach: along the way that depth shows to be free, in legs, each followed by another look."""

import math
from typing import NamedTuple

from contracts.depth_assist import ApproachAnswer, ApproachQuestion, ApproachSettings
from contracts.event_data import ApproachData, LostData
from contracts.geometry import Box, Point3, Pose
from mission.phases.explore import Exploration, Found
from mission.sighting import project
from mission.sortie import Look, Sight, Sortie, distance_m

MAX_LEGS = 8
LOOK_AGAIN_M = 5.0
LONGEST_LEG_M = 8.0
SAME_THING_M = 2.0
OTHER_THING_M = 4.0
"""So far from where the thing was seen, it is another one of its kind."""
NEAR_ENOUGH_M = 0.8
STILL_NEAR_M = 1.3
"""So much farther than the stop a claim is still worth making where there is no way nearer."""
TIGHT_CLEARANCE_M = 0.25
MAX_ASIDES = 2
"""How often a thing that no way leads to is looked at from another side before the search goes on."""


class Arrived(NamedTuple):
    """In front of the window, the object confirmed from nearer than at first sight."""

    place: Point3


class Lost(NamedTuple):
    """The sighting did not stand up, or the way to it is not free (`blocked`)."""

    place: Point3
    why: str
    blocked: bool = False


async def approach(exploration: Exploration, found: Found) -> Arrived | Lost:
    """Flies to the sighting; back to where it was made if that fails. Raises MissionEnd, PortError."""
    sortie = exploration.sortie
    trail = [_at(found.look.pose)]
    end = await _legs(exploration, found, trail)
    if isinstance(end, Lost):
        sortie.write(end.why, LostData(place=end.place, blocked=end.blocked))
        back = trail[-2::-1]
        if back:
            await sortie.fly(back, found.look.pose.yaw, "back to where the search was left")
    return end


def _at(pose: Pose) -> Point3:
    return Point3(x=pose.x, y=pose.y, z=pose.z)


async def _legs(exploration: Exploration, found: Found, trail: list[Point3]) -> Arrived | Lost:
    """Adds every corner of the way flown to `trail`: between the ends of a leg something may stand."""
    sortie = exploration.sortie
    settings = sortie.settings.approach
    # at first sight means: looks on the way tell better where it is, but not whether
    confirmed, tight = not exploration.looks_again, False
    claimable = found.claimable
    if not confirmed and distance_m(found.look.pose, found.place) <= LOOK_AGAIN_M + 1.0:
        # near already: one leg would end too close to look again, so the second look is from here, face to face
        pose = found.look.pose
        towards = math.atan2(found.place.y - pose.y, found.place.x - pose.x)
        await sortie.fly((), towards, "turn to what was seen")
        again = await _again(exploration, await sortie.look(), found, "face to face")
        sure = found.claimable and found.sighting.match.confidence >= sortie.settings.sightings.sure_confidence
        if again is None and not sure:
            return Lost(found.place, "not seen again face to face")
        found = again or found
        claimable = claimable or found.claimable
        if not claimable:
            return Lost(found.place, f"only {found.sighting.match.confidence:.2f} sure face to face")
        confirmed = True
    look, sight, box = found.look, found.sight, found.sighting.match.box
    asides, surest = 0, 0.0
    for leg in range(1, MAX_LEGS + 1):
        far = distance_m(look.pose, found.place)
        way = await _way(sortie, look, sight, box, far, confirmed, settings)
        if way.status != "clear":
            if confirmed and far <= settings.stop_distance_m + (STILL_NEAR_M if tight else NEAR_ENOUGH_M):
                return Arrived(found.place)
            why = "no depth in its box" if way.status == "no_depth" else "the way there is not free"
            if not way.aside or asides >= MAX_ASIDES:
                return Lost(found.place, f"leg {leg}: {why}", way.status == "blocked")
            asides += 1
        path = way.path or way.aside
        end = path[-1] if path else sortie.flown.pose
        # until the stop is reached, the front camera keeps the thing in sight
        yaw = way.facing_yaw if way.reached else math.atan2(found.place.y - end.y, found.place.x - end.x)
        await sortie.fly(path, yaw, f"leg {leg} of the approach" + (", to another side of it" if way.aside else ""))
        trail += [*path[:-1], _at(sortie.flown.pose)]
        look = await sortie.look()
        seen = await exploration.search(look, f"after leg {leg}", near=found.place)
        again = _same(seen, found)
        surest = max(surest, found.sighting.match.confidence)
        if again is not None:
            found = again
            claimable = claimable or again.claimable
            confirmed = confirmed or claimable
            sight, box = again.sight, again.sighting.match.box
            if way.reached and not confirmed:
                return Lost(found.place, f"only {again.sighting.match.confidence:.2f} sure from near")
        elif not confirmed:
            why = f"not seen again from {distance_m(look.pose, found.place):.1f} m"
            return Lost(found.place, why, blocked=bool(way.aside))
        elif seen is not None and await _is_another(exploration, seen, found, surest):
            return Lost(found.place, f"not seen again, and a surer one {distance_m(seen.place, found.place):.1f} m off")
        else:
            # confirmed before: a thing may leave the picture or the model's grasp as it gets near, its place does not
            remembered = project(found.place, found.sighting.extent, look) if found.sighting.extent else None
            if remembered is None:
                return Arrived(found.place) if way.reached else Lost(found.place, f"leg {leg}: out of sight")
            sight, box = remembered
        if way.reached and confirmed:
            far = distance_m(look.pose, found.place)
            if far <= settings.stop_distance_m + (STILL_NEAR_M if tight else NEAR_ENOUGH_M):
                return Arrived(found.place)
            if tight:
                return Lost(found.place, f"leg {leg}: no way nearer than {far:.1f} m from this side", blocked=True)
            # a balcony or eaves beside the window kept the drone off: in still air less room will do for the last metre
            tight = True
            settings = settings.model_copy(update={"clearance_m": min(settings.clearance_m, TIGHT_CLEARANCE_M)})
    return Lost(found.place, f"not there after {MAX_LEGS} legs")


async def _again(exploration: Exploration, look: Look, found: Found, what: str) -> Found | None:
    """The same thing in another look; null where it isn't seen."""
    return _same(await exploration.search(look, what, near=found.place), found)


def _same(seen: Found | None, found: Found) -> Found | None:
    """What was seen, if it is the same thing."""
    return seen if seen is not None and distance_m(seen.place, found.place) <= SAME_THING_M else None


async def _is_another(exploration: Exploration, seen: Found, found: Found, surest: float) -> bool:
    """Is what was seen from near another thing of the kind, on the building searched, and surer than what brought the
    drone here ever was? At first sight means that no look on the way can drop a thing."""
    surer = seen.claimable and seen.sighting.match.confidence > surest
    far = distance_m(seen.place, found.place) > OTHER_THING_M
    return exploration.looks_again and surer and far and await exploration.is_on_target(seen)


async def _way(
    sortie: Sortie, look: Look, sight: Sight, box: Box, far_m: float, confirmed: bool, settings: ApproachSettings
) -> ApproachAnswer:
    """The next leg: to where a second look is worth it, and once that confirmed the object, all the way."""
    leg_m = LONGEST_LEG_M if confirmed else min(LONGEST_LEG_M, far_m - LOOK_AGAIN_M)
    question = ApproachQuestion(
        view=sight.depth_view,
        others=look.depth_beside(sight, reach_deg=90),
        box=box,
        pose=sight.pose,
        settings=settings,
        max_leg_m=leg_m if leg_m > 1.0 else LONGEST_LEG_M,
    )
    answer = await sortie.timed("approach", sortie.ports.depth.approach(question))
    sortie.write(
        f"way to the window: {answer.status}" + (", up to the stop" if answer.reached else ""),
        ApproachData(answer=answer, max_leg_m=round(question.max_leg_m, 2), confirmed=confirmed),
    )
    return answer
