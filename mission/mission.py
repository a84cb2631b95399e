"""One delivery, from a sentence to a window: parse -> place -> floors -> explore -> approach -> claim.

The mission knows four ports and nothing else: no scene, no ids, no truth. `MissionSettings` holds every free constant.
"""

import asyncio
import logging
import time
from collections.abc import Awaitable

from contracts.event_data import ParsedData, PlacedData
from contracts.llm_parser import ParseQuestion
from contracts.orchestrator import DeliveryResult, MissionSettings, OutcomeName
from contracts.sim import Claim, Episode, EpisodeQuestion, Verdict
from contracts.vlm_gateway import PreflightQuestion
from mission.asking import Answered
from mission.phases.approach import Lost, approach
from mission.phases.explore import Exploration, Found
from mission.phases.floors import go_to_floor
from mission.ports import ModelUnreachable, PortError, Ports, ServiceRefused, ServiceUnreachable
from mission.record import Log
from mission.sighting import Dismissed
from mission.sortie import Look, MissionEnd, Sortie, spoken

log = logging.getLogger("mission")

MAX_APPROACHES = 8
END_DEADLINE_S = 5.0


class Mission:
    """Flies one delivery. Whatever happens, `fly` returns a result and gives the episode back."""

    def __init__(self, ports: Ports, settings: MissionSettings, events: Log) -> None:
        self._sortie = Sortie(ports, settings, events)
        self._episode: Episode | None = None
        self._verdict: Verdict | None = None
        self._exploration: Exploration | None = None

    async def fly(self, request: str, start: EpisodeQuestion) -> DeliveryResult:
        """`start` goes to the world as it is. A cancelled task ends the mission with outcome `cancelled`."""
        began = time.perf_counter()
        outcome, message = await self._ended(self._phases(request, start))
        await self._give_back()
        self._sortie.book.seconds["total"] = time.perf_counter() - began
        return self._result(outcome, message)

    async def _phases(self, request: str, start: EpisodeQuestion) -> MissionEnd:
        await self._parse(request)
        await self._preflight()
        await self._place(start)
        await go_to_floor(self._sortie)
        await self._search()
        return self._judged()

    async def _parse(self, request: str) -> None:
        """Raises MissionEnd: request_incomplete, request_unreadable."""
        sortie = self._sortie
        sortie.enter("parse", "reading the request")
        question = ParseQuestion(request=request, model=sortie.settings.parser_model)
        reply = await sortie.book.ask("parser", sortie.ports.parser.parse(question))
        answer = reply.answer
        sortie.floor, sortie.object = answer.floor, answer.object
        found = f"floor {answer.floor or '?'}, {answer.object or 'no object'}"
        sortie.write(
            found if isinstance(reply, Answered) else f"the parser's answer was {answer.outcome}",
            ParsedData(request=request, answer=answer, seconds=round(reply.seconds, 4)),
        )
        if not isinstance(reply, Answered):
            raise MissionEnd("request_unreadable", f"the language model's answer to the request was {answer.outcome}")
        missing = [name for name, value in (("floor", answer.floor), ("object", answer.object)) if value is None]
        if missing:
            wanted = " and no ".join({"floor": "floor", "object": "object at the window"}[name] for name in missing)
            raise MissionEnd("request_incomplete", f"the request names no {wanted}; say both, and the search can begin")

    async def _preflight(self) -> None:
        """Whether the model has ever learnt to see the object, asked while the drone stands. Raises MissionEnd
        (object_unknown), PortError."""
        sortie = self._sortie
        question = PreflightQuestion(model=sortie.settings.vision_model, object=sortie.object)
        answer = await sortie.timed("preflight", sortie.ports.vision.preflight(question))
        if answer.known is False:
            raise MissionEnd(
                "object_unknown",
                f"the drone did not take off: it has never learnt to recognise {sortie.thing} ({answer.why}); "
                "name another thing at the window, or choose a model that knows more",
            )

    async def _place(self, start: EpisodeQuestion) -> None:
        sortie = self._sortie
        sortie.enter("place", "placing the drone")
        sortie.rig = start.rig
        episode = self._episode = await sortie.timed("place", sortie.ports.world.start(start))
        sortie.episode = episode.vehicle
        sortie.write(
            f"the drone stands at {spoken(episode.vehicle.pose)}; pictures by {episode.renderer}",
            PlacedData(
                episode=episode.id,
                pose=episode.vehicle.pose,
                renderer=episode.renderer,
                renderer_detail=episode.renderer_detail,
                flight=episode.flight,
            ),
        )

    async def _search(self) -> None:
        """Explore until the object is seen, approach it. What does not stand up is dismissed, what can't be reached is
        tried from elsewhere; the search goes on."""
        sortie = self._sortie
        exploration = self._exploration = Exploration(sortie)
        last: Lost | None = None
        leaving: Look | None = None
        for _ in range(MAX_APPROACHES):
            sortie.enter("explore", f"looking for {sortie.thing} on floor {sortie.floor}")
            found = await self._found(exploration, leaving, last)
            sortie.enter("approach", f"flying to the {sortie.object} {found.sighting.distance_m:.1f} m away")
            end = await approach(exploration, found)
            if not isinstance(end, Lost):
                sortie.enter("claim", "claiming the window")
                self._verdict = await sortie.timed(
                    "claim", sortie.ports.world.claim(sortie.flown.id, Claim(target=end.place))
                )
                sortie.write(_spoken_verdict(self._verdict), self._verdict)
                return
            last, leaving = end, found.look if end.blocked else None
            if not end.blocked:
                exploration.dismissed.append(Dismissed(end.place, found.look.pose, found.sighting.match.confidence))
        if last is not None and last.blocked:
            raise _blocked(last)
        raise MissionEnd("object_not_found", f"{MAX_APPROACHES} sightings did not stand up to a nearer look")

    async def _found(self, exploration: Exploration, leaving: Look | None, last: Lost | None) -> Found:
        """The next sighting. One that could not be reached and never came back into sight is the better reason."""
        try:
            return await exploration.until_found(leaving)
        except MissionEnd as end:
            if end.outcome == "object_not_found" and last is not None and last.blocked:
                raise _blocked(last) from None
            raise

    def _inspected_share(self) -> float | None:
        contour = self._exploration.contour if self._exploration is not None else None
        return contour.inspected_share if contour is not None else None

    def _judged(self) -> MissionEnd:
        """The claim's verdict as the delivery's outcome."""
        verdict = self._verdict
        if verdict is None:
            return MissionEnd("failed", "the mission ended without a claim")
        if verdict.collided:
            return MissionEnd("collision", "the drone collided on its way")
        if verdict.delivered:
            return MissionEnd("delivered", _spoken_verdict(verdict))
        if verdict.right_window is False:
            return MissionEnd("wrong_window", _spoken_verdict(verdict))
        return MissionEnd("not_in_front", _spoken_verdict(verdict))

    async def _ended(self, phases: Awaitable[MissionEnd]) -> tuple[OutcomeName, str]:
        """Runs the phases; every way they can end has a name."""
        try:
            end = await phases
        except MissionEnd as early:
            end = early
        except ModelUnreachable as error:
            end = MissionEnd("model_unreachable", str(error))
        except ServiceUnreachable as error:
            end = MissionEnd("service_unreachable", str(error))
        except ServiceRefused as error:
            end = MissionEnd("failed", str(error))
        except asyncio.CancelledError:
            task = asyncio.current_task()
            if task is not None:
                task.uncancel()
            end = MissionEnd("cancelled", f"cancelled during {self._sortie.phase}")
        except Exception as error:
            log.exception("a mission broke off")
            end = MissionEnd("failed", f"an unexpected {type(error).__name__} during {self._sortie.phase}")
        return end.outcome, end.message

    async def _give_back(self) -> None:
        episode = self._sortie.episode
        if episode is None:
            return
        try:
            await asyncio.wait_for(self._sortie.ports.world.end(episode.id), END_DEADLINE_S)
        except (PortError, TimeoutError) as error:
            log.warning("the episode could not be given back (it expires by itself): %s", error)

    def _result(self, outcome: OutcomeName, message: str) -> DeliveryResult:
        sortie = self._sortie
        episode = sortie.episode
        return DeliveryResult(
            outcome=outcome,
            message=message,
            steps=sortie.steps,
            exploration_steps=sortie.exploration_steps,
            path_m=episode.path_m if episode else 0.0,
            path_horizontal_m=episode.path_horizontal_m if episode else 0.0,
            flight_s=episode.flight_s if episode else 0.0,
            floor=sortie.floor,
            object=sortie.object,
            final_height_m=sortie.final_height_m,
            pose=episode.pose if episode else None,
            verdict=self._verdict,
            timings_s={part: round(s, 4) for part, s in sortie.book.seconds.items()},
            model_calls=dict(sortie.book.calls),
            renderer=self._episode.renderer if self._episode else None,
            stops=tuple(sortie.stops),
            inspected_share=self._inspected_share(),
        )


def _blocked(last: Lost) -> MissionEnd:
    return MissionEnd("blocked", f"the object was seen, but the way to its window is not free ({last.why})")


def _spoken_verdict(verdict: Verdict) -> str:
    if not verdict.judged:
        return "stopped in front of a window; the scene names no goal to judge by"
    where = f"{verdict.distance_m:.1f} m from the window's centre" if verdict.distance_m is not None else "off"
    if verdict.delivered:
        return f"in front of the right window, {where}"
    if verdict.right_window is False:
        return f"claimed a window that is not the customer's ({where} of that one)"
    sight = "in front of it" if verdict.in_front else "not in front of it"
    clear = "in clear sight" if verdict.line_of_sight else "without a clear line of sight"
    return f"the right window, but {where}, {sight}, {clear}"
