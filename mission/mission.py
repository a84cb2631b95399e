"""One delivery, from a sentence to a window: the loop over `advance`, every way that it can end, and its result.

The mission knows its ports and its placement, and nothing else: no scene, no ids, no truth. `MissionSettings` holds
every free constant.
"""

import asyncio
import contextlib
import logging
import time
from collections.abc import Callable
from dataclasses import replace

from contracts.flight_limits import FlightLimits
from contracts.orchestrator import DeliveryResult, MissionSettings, OutcomeName
from mission.advance import run
from mission.clearances import within_limits
from mission.customer import Customer
from mission.outages import Patience, put_off, told_with_waiting
from mission.placement import Placement
from mission.policies import completed, policy_of
from mission.policies.base import AnyPolicy
from mission.ports import ModelUnreachable, PortError, Ports, ServiceUnreachable
from mission.record import Log
from mission.stages import Ended
from mission.state import MissionState, Outage, begin
from mission.step import MissionContext, Step

log = logging.getLogger("mission")

RELEASE_DEADLINE_S = 5.0
STATE_DEADLINE_S = 2.0

Keep = Callable[[MissionState], None]
"""Is told each state as soon as it is reached."""


class Mission:
    """Flies one delivery. Whatever happens, `fly` returns a result and gives the drone back."""

    def __init__(
        self,
        ports: Ports,
        placement: Placement,
        settings: MissionSettings,
        events: Log,
        *,
        limits: FlightLimits | None = None,
        customer: Customer | None = None,
        keep: Keep | None = None,
        policy: AnyPolicy | None = None,
        patience: Patience | None = None,
    ) -> None:
        """`limits`: the operator's, which the settings may tighten. Without a `customer` nobody is asked: a request
        that leaves something open ends the mission. `policy`: searches instead of the one that the settings name.
        `patience`: with services and models that are away; without it there is none. Raises BadSearch for a search
        policy that there is not, or settings that it has not got."""
        limits = (limits or FlightLimits()).tightened(settings.limits)
        settings = within_limits(completed(settings, policy), limits)
        policy = policy or policy_of(settings.viewpoint)
        self._context = MissionContext(ports, placement, settings, policy, events, limits, customer)
        self._keep = keep
        self._patience = patience or Patience()
        self.problem: Exception | None = None
        """The unexpected error that a mission with outcome `failed` broke off by, where it was one."""

    async def fly(self, request: str, key: str | None = None) -> DeliveryResult:
        """A mission from its beginning; `key` names the delivery. A cancelled task ends it with outcome `cancelled`."""
        return await self.go_on(begin(request, key))

    async def go_on(self, state: MissionState) -> DeliveryResult:
        """A mission from where it was left, perhaps by another process."""
        while not state.over:
            state = await self.advanced(state)
            if self._keep is not None:
                self._keep(state)
        await self.release(state)
        return self.result(state)

    def result(self, state: MissionState) -> DeliveryResult:
        """The result of a mission that has ended. Raises ValueError for one that has not."""
        return result_of(state, self._context)

    async def advanced(self, state: MissionState) -> MissionState:
        """The next state; a step for which a machine is away is put off, and tried again by the next call. Every other
        way that a step can break off ends the mission, and has a name."""
        step = Step(state, self._context)
        began = time.monotonic()
        try:
            if state.outage is not None:
                await step.timed("outage", self._patience.pause(state.outage))
            step.context = self._context = await self._context.with_drone(state)
            state = await run(step)
            self._context = step.context
            return state
        except PortError as error:
            before, tried_s = step.settled.outage, time.monotonic() - began
            outage = self._patience.outage(before, error, tried_s)
            end = Ended(outcome=_outcome_of(error), message=told_with_waiting(error, before, tried_s))
            if outage is not None:
                try:
                    return self._put_off(step, outage, error)
                except Exception as raised:
                    end = self._broken_off(step, raised)
        except asyncio.CancelledError:
            task = asyncio.current_task()
            if task is not None:
                task.uncancel()
            end = Ended(outcome="cancelled", message=f"cancelled during {step.state.phase}")
        except Exception as error:
            end = self._broken_off(step, error)
        self._context = step.context
        if step.settled.outage is not None:
            step.unsettle()
        if step.state.flight is not None:
            await _look_where_it_stopped(step)
        step.update(stage=end, flight=None, outage=None)
        try:
            step.settle()
        except Exception as error:
            step.update(stage=self._broken_off(step, error))
        return step.state

    def _broken_off(self, step: Step, error: Exception) -> Ended:
        log.error("a mission broke off", exc_info=error)
        self.problem = error
        return Ended(outcome="failed", message=f"an unexpected {type(error).__name__} during {step.state.phase}")

    def _put_off(self, step: Step, outage: Outage, error: PortError) -> MissionState:
        log.warning("%s waits, try %d: %s", step.state.key, outage.tries, outage.why)
        state = put_off(step, outage, self._patience.within_s)
        there = isinstance(error, ModelUnreachable) and state.vehicle is not None
        # the vehicle at hand may have gone with its service, and is asked for anew
        self._context = step.context if there else replace(step.context, drone=None)
        return state

    async def release(self, state: MissionState) -> None:
        """Gives the state's vehicle back, where it has one."""
        if state.vehicle is None:
            return
        try:
            async with asyncio.timeout(RELEASE_DEADLINE_S):
                context = await self._context.with_drone(state)
                if context.drone is not None:
                    await context.drone.vehicle.release()
        except (PortError, TimeoutError) as error:
            log.warning("the drone %s could not be given back: %s", state.vehicle, error)


async def _look_where_it_stopped(step: Step) -> None:
    """Of a flight that was broken off on its way; what is known of the drone stays where it does not answer."""
    if step.context.drone is None:
        return
    with contextlib.suppress(PortError, TimeoutError):
        async with asyncio.timeout(STATE_DEADLINE_S):
            step.update(drone=await step.context.drone.vehicle.state())


def _outcome_of(error: PortError) -> OutcomeName:
    if isinstance(error, ModelUnreachable):
        return "model_unreachable"
    return "service_unreachable" if isinstance(error, ServiceUnreachable) else "failed"


def result_of(state: MissionState, context: MissionContext) -> DeliveryResult:
    """The result of a mission that has ended. Raises ValueError for one that has not."""
    end, drone = state.stage, state.drone
    if not isinstance(end, Ended):
        raise ValueError(f"the mission has not ended: its stage is {end.at}")
    memory = context.policy.memory_type.model_validate(state.memory)
    return DeliveryResult(
        outcome=end.outcome,
        message=end.message,
        steps=state.steps,
        exploration_steps=state.exploration_steps,
        path_m=drone.path_m if drone else 0.0,
        path_horizontal_m=drone.path_horizontal_m if drone else 0.0,
        flight_s=drone.flight_s if drone else 0.0,
        floor=state.floor,
        object=state.object,
        final_height_m=state.final_height_m,
        pose=drone.pose if drone else None,
        verdict=state.verdict,
        timings_s={part: round(seconds, 4) for part, seconds in state.seconds.items()},
        model_calls=state.calls,
        renderer=state.renderer,
        rig=context.placement.rig_name,
        sensors=context.placement.sensors_name,
        stops=state.stops,
        search_policy=context.policy.name,
        inspected_share=memory.inspected_share,
    )
