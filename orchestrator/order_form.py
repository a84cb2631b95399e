"""What a delivery may be given, and how a request would be understood, before anything is ordered."""

import asyncio
import contextlib

import anyio.to_thread

from contracts.llm_parser import ParseQuestion
from contracts.overview import NamedOption, OrderOptions, Reading, ReadingQuestion, SampleOption
from contracts.vlm_gateway import PreflightQuestion
from mission.policies import DEFAULT, label_of, policy_names
from mission.ports import PortError
from mission.questions import about_unknown, missing_fields, question_of
from orchestrator import sample_library
from orchestrator.hangar import Hangar
from orchestrator.roll_call import RollCall
from service_kit.errors import BadQuestion, Unavailable

ASK_S = 20.0


class OrderForm:
    """Asks the services that a mission asks; nothing is ordered by it."""

    def __init__(self, hangar: Hangar, fleet: RollCall) -> None:
        self._hangar = hangar
        self._fleet = fleet

    async def options(self) -> OrderOptions:
        """What there is to choose from now."""
        kinds = {member.kind for member in self._hangar.members}
        samples = await anyio.to_thread.run_sync(_samples)
        searches = [NamedOption(name=name, label=label_of(name), usual=name == DEFAULT) for name in policy_names()]
        return OrderOptions(
            samples=samples,
            models=await self._models(),
            searches=tuple(searches),
            vehicles=await self._fleet.list(),
            scenes="simulator" in kinds,
            own_place="vehicle" in kinds,
        )

    async def reading(self, question: ReadingQuestion) -> Reading:
        """How the parser reads it, and what a delivery would ask. Raises BadQuestion for a request that the parser's
        model could not read, Unavailable where nobody reads it now."""
        ports = self._hangar.ports()
        asked = ParseQuestion(request=question.request, exchanges=question.exchanges)
        try:
            answer = await asyncio.wait_for(ports.parser.parse(asked), ASK_S)
        except (PortError, TimeoutError) as error:
            raise Unavailable(f"nobody reads requests now: {error}", code="parser_unreachable") from None
        if answer.outcome != "answered":
            raise BadQuestion(f"the parser's answer was {answer.outcome}; say it in other words", code="not_read")
        if missing_fields(answer) or answer.object is None:
            return Reading(answer=answer, question=question_of(answer))
        known: bool | None = None
        with contextlib.suppress(PortError, TimeoutError):  # the mission itself will ask, and say what is wrong
            preflight = PreflightQuestion(model=question.model, object=answer.object)
            known = (await asyncio.wait_for(ports.vision.preflight(preflight), ASK_S)).known
        return Reading(answer=answer, question=about_unknown(answer.object) if known is False else None, known=known)

    async def _models(self) -> tuple[NamedOption, ...] | None:
        try:
            listed = await asyncio.wait_for(self._hangar.models(), ASK_S)
        except (PortError, TimeoutError):
            return None
        return tuple(
            NamedOption(name=m.id, label=f"{m.id} ({m.owned_by})", usual="recognition" in m.roles) for m in listed
        )


def _samples() -> tuple[SampleOption, ...]:
    found = [sample_library.load(name) for name in sample_library.names()]
    return tuple(SampleOption(name=s.name, title=s.title, difficulty=s.difficulty, request=s.request) for s in found)
