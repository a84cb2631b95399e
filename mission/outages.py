"""Steps for which a machine was away, a service or the server of a model: put off, and tried again for a while.

A step that is put off changes nothing but the mission's `outage`, so that whoever carries the mission on goes on
waiting, and does the step from where it stood: no flight is flown twice. The drone holds meanwhile.
"""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass

from contracts.event_data import OutageData
from mission.frames import FlightRefused
from mission.ports import PortError
from mission.state import MissionState, Outage
from mission.step import Step
from mission.wording import spoken_duration

DEFAULT_WITHIN_S = 60.0
"""Longer than a service takes to be started again, and many a model server to load."""
FIRST_PAUSE_S = 0.5
LONGEST_PAUSE_S = 5.0
_DOUBLINGS = 4


def _never() -> bool:
    return False


@dataclass(frozen=True)
class Patience:
    """For how long a step is tried again, 0 for not at all. `hopeless`: is it known that what is away stays away, as
    a process does that nobody starts again?"""

    within_s: float = 0.0
    hopeless: Callable[[], bool] = _never

    def outage(self, before: Outage | None, error: PortError, tried_s: float) -> Outage | None:
        """What is waited for after a try that took so long, the pause before it included; null where it is not."""
        waited_s = 0.0 if before is None else before.waited_s + tried_s
        if not error.passing or waited_s >= self.within_s or self.hopeless():
            return None
        return Outage(why=str(error), tries=1 if before is None else before.tries + 1, waited_s=waited_s)

    async def pause(self, outage: Outage) -> None:
        """Until the next try; the last one is at the end of the time."""
        pause_s = min(FIRST_PAUSE_S * 2 ** min(outage.tries - 1, _DOUBLINGS), LONGEST_PAUSE_S)
        await asyncio.sleep(max(0.0, min(pause_s, self.within_s - outage.waited_s)))


def put_off(step: Step, outage: Outage, within_s: float) -> MissionState:
    """The state from which the step is tried again: as it stood, but for what its calls have cost and shown."""
    begins = step.settled.outage is None
    step.unsettle()
    step.update(outage=outage)
    if begins:
        data = OutageData(why=outage.why, waited_s=0.0, over=False)
        step.write(f"waits up to {spoken_duration(within_s)}: {outage.why}", data)
    step.settle()
    return step.state


async def try_again(step: Step) -> None:
    """Before a step that was put off is done. Raises MissionEnd (stopped_by_guard) where the drone may not wait any
    longer, PortError."""
    outage = step.state.outage
    if outage is None:
        return
    if step.state.vehicle is not None:
        try:
            await step.drone.vehicle.watch()
        except FlightRefused as refusal:
            said = f"the flight guard ends the waiting: {refusal.message} ({outage.why})"
            await step.stop(refusal, (), said)
    step.update(outage=None)
    waited = spoken_duration(outage.waited_s)
    data = OutageData(why=outage.why, waited_s=round(outage.waited_s, 3), over=True)
    step.write(f"goes on: what was away answers again after {waited}", data)


def told_with_waiting(error: PortError, before: Outage | None, tried_s: float) -> str:
    """Why the mission ends, and how long that was waited for."""
    waited_s = 0.0 if before is None else before.waited_s + tried_s
    return str(error) if waited_s < 1.0 else f"{error}; waited {spoken_duration(waited_s)}"
