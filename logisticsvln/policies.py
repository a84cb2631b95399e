"""A search policy from whatever says where to look next: a name, a class, an object, or a function."""

import asyncio
import inspect
from collections.abc import Awaitable, Callable
from typing import ClassVar, TypeAlias

from contracts.base import Wire
from contracts.orchestrator import MissionSettings, SearchSettings
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
        return of_function(given)
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
        said = await call(self._decide, self._look, self._tools)
        if not isinstance(said, NextStop | NothingLeft):
            raise TypeError(f"a policy says NextStop(...) or NothingLeft(...), not {said!r}")
        return Onward(said, self._memory)


async def call(function: Callable[..., object], *arguments: object) -> object:
    """Somebody's function: awaited where it is asynchronous, else run in a thread, since it may take its time."""
    if inspect.iscoroutinefunction(function) or inspect.iscoroutinefunction(getattr(function, "__call__", None)):  # noqa: B004
        return await function(*arguments)  # type: ignore[misc]
    said = await asyncio.to_thread(function, *arguments)
    return await said if inspect.isawaitable(said) else said
