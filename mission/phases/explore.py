"""Object exploration: look round with all five cameras; where the object is not in sight, fly on round the building."""

import asyncio
import math
from collections.abc import Awaitable, Callable, Iterable
from dataclasses import dataclass, field
from functools import partial
from typing import NamedTuple

from contracts.depth_assist import (
    DirectionPoint,
    SafeDistancesAnswer,
    SafeDistancesQuestion,
    ViewpointAnswer,
    ViewpointQuestion,
)
from contracts.event_data import DirectionData, JudgedMatch, LookData
from contracts.geometry import Point3, Pose
from contracts.images import JpegImage, encode_jpeg, jpeg_bytes
from contracts.vlm_gateway import (
    ChooseDirectionAnswer,
    ChooseDirectionQuestion,
    FindObjectAnswer,
    FindObjectQuestion,
    MarkedPoint,
    Match,
    View,
)
from mission.asking import Answered, Reply
from mission.marks import mark_box, mark_points
from mission.phases.contour import ContourSearch
from mission.sighting import SAME_PLACE_M, Dismissed, Sighting, facade_returns, locate
from mission.sortie import Look, MissionEnd, Sight, Sortie, ahead, distance_m, towards
from mission.wording import counted, with_article

TRIES = 2


class Found(NamedTuple):
    """The object in one view, at a place that can be the window asked for; `claimable`: sure enough to be claimed."""

    look: Look
    sight: Sight
    sighting: Sighting
    place: Point3
    claimable: bool


class Onward(NamedTuple):
    """The way on from a look: `fly` takes it; `on_target` says whether a place is on the building searched, as far as
    is known (the paper's rule keeps no map: anything may be)."""

    fly: Callable[[], Awaitable[None]]
    on_target: Callable[[Point3], bool]


class Ways(NamedTuple):
    """Where to look for the way on, and how far one may fly there; `marked` is what the choice model is shown."""

    view: ViewpointAnswer
    safe: SafeDistancesAnswer
    marked: JpegImage


class Chosen(NamedTuple):
    """Where to go: a point, or null to turn on the spot; `by` says who chose, or why not."""

    point: DirectionPoint | None
    by: str


@dataclass
class Exploration:
    """The search round the building; an approach may interrupt it, and it can be taken up again."""

    sortie: Sortie
    dismissed: list[Dismissed] = field(default_factory=list)
    contour: ContourSearch | None = None
    _d_max_m: float | None = None
    _silent: int = 0

    def __post_init__(self) -> None:
        if self.sortie.settings.viewpoint.policy == "contour":
            self.contour = ContourSearch(self.sortie)

    async def until_found(self, leaving: Look | None = None) -> Found:
        """Flies until the object is seen; `leaving` is a look whose sighting is to be tried from elsewhere. Raises
        MissionEnd: object_not_found after the last step, answer_unreadable after too many useless answers in a row;
        PortError."""
        sortie, settings = self.sortie, self.sortie.settings
        if leaving is not None and sortie.exploration_steps < settings.max_exploration_steps:
            await (await self._onward(leaving)).fly()
        while sortie.exploration_steps < settings.max_exploration_steps:
            sortie.exploration_steps += 1
            look = await sortie.look()
            # the way on is worked out while the model looks; mostly it is needed
            onward = asyncio.create_task(self._onward(look))
            try:
                found = await self.search(look, f"step {sortie.exploration_steps}", onward=onward)
                if found is not None:
                    return found
                if sortie.exploration_steps < settings.max_exploration_steps:
                    await (await onward).fly()
            finally:
                onward.cancel()
                await asyncio.gather(onward, return_exceptions=True)
        looked = f"after {counted(sortie.exploration_steps, 'exploration step')}"
        if self.contour is not None and self.contour.inspected_share is not None:
            looked += f", with {100 * self.contour.inspected_share:.0f} % of the known facade inspected"
        if self.dismissed:
            looked += f"; {counted(len(self.dismissed), 'sighting')} did not stand up to a nearer look"
        raise MissionEnd("object_not_found", f"no window with {sortie.thing} was found {looked}")

    async def search(
        self, look: Look, what: str, near: Point3 | None = None, onward: Awaitable[Onward] | None = None
    ) -> Found | None:
        """Asks for the object in all views at once; `near` prefers the sighting closest to a place, `onward` knows
        what is on the target building. Raises MissionEnd (answer_unreadable), PortError."""
        sortie = self.sortie
        sortie.count_stop()
        question = FindObjectQuestion(
            model=sortie.settings.vision_model,
            oracle_episode=sortie.flown.id,
            object=sortie.object or "",
            views=tuple(View(heading_deg=s.heading_deg, image=s.view.image) for s in look.sights.values()),
        )
        reply = await sortie.book.ask("recognition", sortie.ports.vision.find_object(question))
        sightings: list[Sighting] = []
        claim = self._claim_confidence(reply.answer)
        if isinstance(reply, Answered):
            self._silent = 0
            worth = min(claim, sortie.settings.sightings.candidate_confidence) if self.looks_again else claim
            matches = [m for m in reply.answer.matches if m.heading_deg in look.sights and m.confidence >= worth]
            sightings = [self._judge(m, look, claimable=m.confidence >= claim) for m in matches]
            if onward is not None and any(s.rejected is None for s in sightings):
                sightings = _of_target(sightings, (await onward).on_target)
        else:
            self._silent += 1
        best = _best(sightings, near)
        sortie.write(
            f"{what}: {_said(reply.answer.outcome, sightings, best, sortie.object or 'object')}",
            LookData(
                exploration_step=sortie.exploration_steps,
                pose=look.pose,
                object=sortie.object,
                answer=reply.answer,
                sightings=tuple(_judged(s, s is best) for s in sightings),
                returns=tuple(facade_returns([look.sights[h] for h in (-90, 0, 90) if h in look.sights])),
                render_s=look.observation.timings_s.get("render", 0.0),
                seconds=round(reply.seconds, 4),
            ),
            lambda: look.pictures | _boxed(look, best),
        )
        if self._silent > sortie.settings.max_model_failures:
            raise MissionEnd(
                "answer_unreadable",
                f"the recognition model gave {self._silent} answers in a row that say nothing ({reply.answer.outcome})",
            )
        if best is None or best.place is None:
            return None
        return Found(
            look, look.sights[best.match.heading_deg], best, best.place, claimable=best.match.confidence >= claim
        )

    @property
    def looks_again(self) -> bool:
        """Is a sighting looked at from nearer before it is claimed?"""
        return self.sortie.settings.sightings.policy == "look-again"

    async def is_on_target(self, found: Found) -> bool:
        """Is that on the building searched, as far as is known? The paper's rule keeps no map: anything may be."""
        return self.contour is None or self.contour.on_target(await self.contour.plan(found.look), found.place)

    def _claim_confidence(self, answer: FindObjectAnswer) -> float:
        for confidence in (self.sortie.settings.sightings.claim_confidence, answer.claim_confidence):
            if confidence is not None:
                return confidence
        return 0.0

    def _judge(self, match: Match, look: Look, *, claimable: bool) -> Sighting:
        sortie = self.sortie
        sighting = locate(
            match,
            look.sights[match.heading_deg],
            floor_z=sortie.final_height_m or 0.0,
            floor_height_m=sortie.floor_height_m or 3.0,
        )
        place = sighting.place
        if sighting.rejected is None and place and self._is_dismissed(place, look.pose, match, claimable):
            return sighting._replace(rejected="looked at from near before")
        return sighting

    def _is_dismissed(self, place: Point3, pose: Pose, match: Match, claimable: bool) -> bool:
        tries = sum(distance_m(place, d.place) < SAME_PLACE_M for d in self.dismissed)
        return tries >= TRIES or any(
            d.holds(place, pose, match.confidence, claimable=claimable) for d in self.dismissed
        )

    async def _onward(self, look: Look) -> Onward:
        """Works the way on out and changes nothing: the explorer's stop, or the paper's viewpoint (eq. 4-6), safe
        distances (eq. 7) and the point chosen among them."""
        sortie = self.sortie
        if self.contour is not None:
            plan = await self.contour.plan(look)
            return Onward(partial(self.contour.go_on, look, plan), partial(self.contour.on_target, plan))
        view = await self._viewpoint(look)
        sight = look.sights[view.heading_deg]
        asked = SafeDistancesQuestion(
            view=sight.depth_view,
            others=look.depth_beside(sight),
            settings=sortie.settings.safe_distances,
        )
        safe = await sortie.timed("safe_distances", sortie.ports.depth.safe_distances(asked))
        marked = encode_jpeg(mark_points(sight.rgb, marks_of(self._offered(safe))))
        return Onward(partial(self._go_on, look, Ways(view, safe, marked)), lambda _: True)

    def _offered(self, safe: SafeDistancesAnswer) -> list[DirectionPoint]:
        return [p for p in safe.points if p.distance_m >= self.sortie.settings.min_move_m]

    async def _go_on(self, look: Look, ways: Ways) -> None:
        """The chosen point, and the flight."""
        sortie = self.sortie
        self._d_max_m = ways.view.d_max_next_m
        chosen = await self._choose(ways)
        if chosen.point is None:
            turn = sortie.settings.fallback_turn_deg
            await sortie.fly((), look.pose.yaw + math.radians(turn), f"turn {turn:g}° left: {chosen.by}")
            return
        point = chosen.point
        goal = ahead(look.pose, point.bearing_deg, point.distance_m)
        await sortie.fly((goal,), None, f"{point.distance_m:.1f} m towards point {point.label}, {chosen.by}")

    async def _viewpoint(self, look: Look) -> ViewpointAnswer:
        sortie = self.sortie
        question = ViewpointQuestion(
            views=tuple(s.depth_view for s in look.sights.values()),
            building_box=sortie.building_box,
            settings=sortie.settings.viewpoint,
            d_max_m=self._d_max_m,
            seed=sortie.settings.seed * 1000 + sortie.exploration_steps,
        )
        return await sortie.timed("viewpoint", sortie.ports.depth.viewpoint(question))

    async def _choose(self, ways: Ways) -> Chosen:
        sortie, settings = self.sortie, self.sortie.settings
        view, safe, marked = ways
        offered = self._offered(safe)
        reply: Reply[ChooseDirectionAnswer] | None = None
        if not offered:
            chosen = Chosen(None, f"no way of {settings.min_move_m:g} m is free {towards(view.heading_deg)}")
        elif settings.choice == "centre":
            chosen = _centre(offered, settings.min_move_m)
        else:
            sortie.count_stop()
            question = ChooseDirectionQuestion(
                model=settings.vision_model,
                oracle_episode=sortie.flown.id,
                heading_deg=view.heading_deg,
                image=marked,
                points=marks_of(offered),
                task=search_task(sortie.object or "", sortie.floor or 1, settings.viewpoint.direction),
            )
            reply = await sortie.book.ask("choice", sortie.ports.vision.choose_direction(question))
            label = reply.answer.label if isinstance(reply, Answered) else None
            point = next((p for p in offered if p.label == label), None)
            if point is not None:
                chosen = Chosen(point, "the model's choice")
            else:
                chosen = _widest(offered, f"the choice model's answer was {_why(reply.answer.outcome)}")
        sortie.write(
            f"view {towards(view.heading_deg)} ({view.reason.replace('_', ' ')}): "
            + (f"point {chosen.point.label}, {chosen.by}" if chosen.point else chosen.by),
            DirectionData(
                exploration_step=sortie.exploration_steps,
                heading_deg=view.heading_deg,
                viewpoint=view,
                points=safe.points,
                offered=tuple(p.label for p in offered),
                label=chosen.point.label if chosen.point else None,
                by=chosen.by,
                answer=reply.answer if reply else None,
                seconds=round(reply.seconds, 4) if reply else None,
            ),
            lambda: {"marked": jpeg_bytes(marked)},
        )
        return chosen


def _centre(offered: list[DirectionPoint], min_move_m: float) -> Chosen:
    """The ablation: always the point straight ahead."""
    point = next((p for p in offered if p.label == "c"), None)
    if point is None:
        return Chosen(None, f"the way straight ahead is shorter than {min_move_m:g} m")
    return Chosen(point, "always the centre")


def _widest(offered: list[DirectionPoint], why: str) -> Chosen:
    """Without a usable answer: the centre where it is offered, else the longest way."""
    point = next((p for p in offered if p.label == "c"), None) or max(offered, key=lambda p: p.distance_m)
    return Chosen(point, why)


def marks_of(points: Iterable[DirectionPoint]) -> tuple[MarkedPoint, ...]:
    """The points as they are drawn into the picture and offered to the model."""
    return tuple(MarkedPoint(label=p.label, x=p.x, y=p.y, distance_m=p.distance_m) for p in points)


def search_task(thing: str, floor: int, direction: str) -> str:
    """What the choice model is told about the search; `direction` is the viewpoint settings'."""
    side = "right" if direction == "clockwise" else "left"
    return (
        f"Find the window with {with_article(thing)} on floor {floor}. The drone flies {direction} round the building, "
        f"which is on its {side}."
    )


def _of_target(sightings: list[Sighting], on_target: Callable[[Point3], bool]) -> list[Sighting]:
    """The same, with those rejected that are on another building."""
    return [
        s._replace(rejected="not on the building searched")
        if s.rejected is None and s.place is not None and not on_target(s.place)
        else s
        for s in sightings
    ]


def _best(sightings: list[Sighting], near: Point3 | None) -> Sighting | None:
    """The most confident sighting that was not rejected, or the one closest to `near`."""
    kept = [s for s in sightings if s.rejected is None and s.place is not None]
    if not kept:
        return None
    if near is None:
        return kept[0]
    return min(kept, key=lambda s: distance_m(s.place, near) if s.place else math.inf)


def _why(outcome: str) -> str:
    return "none of the points offered" if outcome == "answered" else outcome


def _said(outcome: str, sightings: list[Sighting], best: Sighting | None, thing: str) -> str:
    if outcome != "answered":
        return f"the recognition model's answer was {outcome}"
    if best is not None:
        return f"{thing} seen {towards(best.match.heading_deg)}, {best.distance_m:.1f} m away"
    if sightings:
        return f"{counted(len(sightings), 'sighting')} rejected: {sightings[0].rejected}"
    return f"no {thing} in sight"


def _judged(sighting: Sighting, accepted: bool) -> JudgedMatch:
    return JudgedMatch(
        **dict(sighting.match),
        place=sighting.place,
        distance_m=round(sighting.distance_m, 2) if sighting.distance_m is not None else None,
        accepted=accepted,
        rejected=sighting.rejected,
    )


def _boxed(look: Look, best: Sighting | None) -> dict[str, bytes]:
    """The view of the sighting, with its box drawn."""
    if best is None:
        return {}
    label = f"{best.match.confidence:.2f}, {best.distance_m:.1f} m" if best.distance_m is not None else ""
    drawn = mark_box(look.sights[best.match.heading_deg].rgb, best.match.box, label)
    return {"sighting": jpeg_bytes(encode_jpeg(drawn))}
