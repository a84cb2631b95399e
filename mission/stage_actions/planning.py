"""The policy's plan from a look, and what of the step under way a policy may use."""

from contracts.depth_assist import (
    ExploreAnswer,
    ExploreQuestion,
    SafeDistancesAnswer,
    SafeDistancesQuestion,
    ViewpointAnswer,
    ViewpointQuestion,
)
from contracts.geometry import Box, Point3
from contracts.vlm_gateway import ChooseDirectionAnswer, ChooseDirectionQuestion
from mission.looks import Look
from mission.model_calls import Reply
from mission.policies.base import Plan, SearchMemory
from mission.step import Step


class StepTools:
    """What a policy may use of the step under way: `mission.policies.base.SearchTools`."""

    def __init__(self, step: Step) -> None:
        self._mission = step
        self.object = step.state.object or ""
        self.floor = step.state.floor or 1
        self.building_box: Box | None = step.state.building_box
        self.exploration_step = step.state.exploration_steps
        self.seed = step.settings.seed * 1000 + step.state.exploration_steps
        self.vision_model = step.settings.vision_model
        self.fallback_turn_deg = step.settings.fallback_turn_deg

    async def viewpoint(self, question: ViewpointQuestion) -> ViewpointAnswer:
        return await self._mission.timed("viewpoint", self._mission.ports.depth.viewpoint(question))

    async def safe_distances(self, question: SafeDistancesQuestion) -> SafeDistancesAnswer:
        return await self._mission.timed("safe_distances", self._mission.ports.depth.safe_distances(question))

    async def explore(self, question: ExploreQuestion) -> ExploreAnswer:
        asked = question.model_copy(update={"keep_out": self._mission.context.limits.keep_out})
        return await self._mission.timed("explore", self._mission.ports.depth.explore(asked))

    async def choose_direction(self, question: ChooseDirectionQuestion) -> Reply[ChooseDirectionAnswer]:
        self._mission.count_stop()
        return await self._mission.ask("choice", self._mission.ports.vision.choose_direction(question))


async def plan_onward(step: Step, look: Look) -> Plan:
    """The policy's plan from this look. Changes nothing but the clock. Raises PortError."""
    return await step.policy.plan(look, memory_of(step), StepTools(step))


def memory_of(step: Step) -> SearchMemory:
    """What the policy remembers of this mission."""
    return step.policy.memory_type.model_validate(step.state.memory)


async def on_target(step: Step, look: Look, place: Point3) -> bool:
    """Is that on the building searched, as far as is known? Without a map anything may be. Raises PortError."""
    return not step.policy.knows_building or (await plan_onward(step, look)).on_target(place)
