"""A search policy from whatever says where to look next: a name, a class, an object, or a function."""

import math
from collections.abc import Awaitable, Callable
from typing import ClassVar, TypeAlias

from contracts.base import Wire
from contracts.geometry import Point3
from contracts.orchestrator import MissionSettings, SearchSettings
from contracts.vehicle import MAX_PATH_POINTS
from logisticsvln.functions import call, must_take
from mission.looks import Look
from mission.policies.base import (
    AnyPolicy,
    NextStop,
    NothingLeft,
    Onward,
    Plan,
    SearchMemory,
    SearchPolicy,
    SearchTools,
)
from orchestrator.delivery import BadDelivery

Decision: TypeAlias = NextStop | NothingLeft
Deciding: TypeAlias = Callable[[Look, SearchTools], Decision | Awaitable[Decision]]
"""Where to look next, out of a look without the object in it. A plain function runs in a thread of its own, one with
`async def` may ask the tools."""
Policy: TypeAlias = str | SearchSettings | AnyPolicy | type[AnyPolicy] | Deciding


class NoSettings(Wire):
    """A function brings no settings."""


def policy_from(given: Policy) -> AnyPolicy | SearchSettings:
    """The policy at hand, or which one the mission is to look up. Raises BadDelivery for what is none."""
    if isinstance(given, str):
        return SearchSettings(policy=given)
    if isinstance(given, SearchSettings | SearchPolicy):
        return given
    if isinstance(given, type):
        if not issubclass(given, SearchPolicy):
            raise BadDelivery(f"policy: {given.__name__} is not derived from SearchPolicy")
        return given(given.settings_type())
    if callable(given):
        return of_function(must_take(given, ("look", "tools"), "policy"))
    raise BadDelivery(
        f"policy: give the name of one, a SearchPolicy, or a function of (look, tools), not {type(given).__name__}"
    )


def with_policy(settings: MissionSettings, given: Policy | None) -> tuple[MissionSettings, AnyPolicy | None]:
    """The settings that name the policy, and the policy itself where it is at hand. Raises BadDelivery."""
    if given is None:
        return settings, None
    policy = policy_from(given)
    if isinstance(policy, SearchSettings):
        return settings.model_copy(update={"viewpoint": policy}), None
    return settings, policy


def of_function(decide: Deciding) -> AnyPolicy:
    """A policy that asks the function for each next stop, and remembers nothing itself."""
    spoken = getattr(decide, "__name__", type(decide).__name__).strip("<>_")

    class OfFunction(SearchPolicy[NoSettings, SearchMemory]):
        name: ClassVar[str] = spoken.replace("_", "-")
        label: ClassVar[str] = spoken.replace("_", " ")
        settings_type = NoSettings

        async def plan(self, look: Look, memory: SearchMemory, tools: SearchTools) -> Plan:
            return _Asked(decide, look, memory, tools)

    return OfFunction(NoSettings())


class _Asked(Plan):
    """Asks the function only where its answer is needed."""

    def __init__(self, decide: Deciding, look: Look, memory: SearchMemory, tools: SearchTools) -> None:
        self._decide, self._look, self._memory, self._tools = decide, look, memory, tools

    async def onward(self) -> Onward:
        said = _sound(await call(self._decide, self._look, self._tools))
        return Onward(said, self._memory)


def _sound(said: object) -> Decision:
    """Raises TypeError, ValueError for what is no next stop."""
    if isinstance(said, NothingLeft):
        return NothingLeft(str(said.why))
    if not isinstance(said, NextStop):
        raise TypeError(f"a policy says NextStop(...) or NothingLeft(...), not {said!r}")
    path = tuple(said.path)
    if any(not isinstance(point, Point3) for point in path):
        raise TypeError(f"NextStop: its path is made of Point3, as ahead(look.pose, ...) gives one, not {said.path!r}")
    if len(path) > MAX_PATH_POINTS:
        raise ValueError(f"NextStop: its path has {len(path)} points; a flight has at most {MAX_PATH_POINTS}")
    if said.yaw is not None and not math.isfinite(said.yaw):
        raise ValueError(f"NextStop: its yaw is a number of radians, or None, not {said.yaw!r}")
    return NextStop(path, None if said.yaw is None else float(said.yaw), str(said.why))
