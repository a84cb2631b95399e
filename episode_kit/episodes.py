"""All live episodes of a world: who may fly, who waits for whom, and when one is ended that nobody flies any more.

Calls on one episode run one after the other. A flight is under way between calls: it is begun by one and advanced in
slices, so that others (a look, the state, a cancellation) find the drone on its way. Different episodes meet only where
they share something real.
"""

import asyncio
import os
import time
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager
from typing import Generic, Protocol, TypeVar

from contracts.sim import Claim, Episode, EpisodeTerms, Verdict
from contracts.vehicle import Move, MoveProgress, MoveResult, Observation, VehicleCapabilities, VehicleState
from episode_kit.begun import BegunEpisodes, Left
from episode_kit.episode import FlyingEpisode
from episode_kit.flight_loop import FlightLoop
from episode_kit.lease import Clock, Lease
from episode_kit.limits import Limits, check_room, granted_lease_s
from service_kit.errors import NotFound


class Seeing(Protocol):
    """What the drone of one episode sees."""

    async def look(self, cameras: Sequence[str] | None, depth: bool) -> Observation:
        """The named cameras' views of one moment, also on the way; all of the rig's where none are named. Raises
        BadQuestion or Unavailable."""
        ...


Q = TypeVar("Q", bound=EpisodeTerms)
E = TypeVar("E", bound=FlyingEpisode)
S = TypeVar("S", bound=Seeing)
T = TypeVar("T")


class Opened(Generic[E, S]):
    """An episode with its senses, and what frees all that both hold."""

    def __init__(self, episode: E, senses: S, close: Callable[[], Awaitable[None]]) -> None:
        self.episode = episode
        self.senses = senses
        self.close = close


class _Live(Generic[E, S]):
    """A live episode with what its calls share."""

    def __init__(self, opened: Opened[E, S], lease: Lease) -> None:
        self.episode = opened.episode
        self.senses = opened.senses
        self.close = opened.close
        self.lease = lease
        self.flight = FlightLoop(opened.episode)
        self.turn = asyncio.Lock()

    @property
    def busy(self) -> bool:
        return self.turn.locked() or self.flight.running

    @property
    def orphaned(self) -> bool:
        return self.lease.over and not self.busy


class LiveEpisodes(ABC, Generic[Q, E, S]):
    """Lives on one event loop. Owns its worker threads."""

    def __init__(self, limits: Limits, clock: Clock = time.monotonic) -> None:
        self.limits = limits
        self._clock = clock
        self._workers = ThreadPoolExecutor(max(4, os.cpu_count() or 1), thread_name_prefix="episodes")
        self._live: dict[str, _Live[E, S]] = {}
        self._begun: BegunEpisodes[Q] = BegunEpisodes(self._begin, self._drop)
        self._starting: Counter[str | None] = Counter()

    @abstractmethod
    async def _open(self, question: Q) -> Opened[E, S]:
        """A drone at its start. Raises BadQuestion or Unavailable, and then keeps nothing."""

    @property
    def live(self) -> int:
        return len(self._live)

    async def start(self, question: Q, left: Left) -> Episode:
        """An episode, or the one that was begun under the same key. One that every caller has `left` before it was
        there is not kept. Raises TooMany, BadQuestion, Conflict or Unavailable."""
        return self.trial(await self._begun.begin(question, left))

    async def free(self, key: str) -> None:
        """Ends what was begun under a key, or is being begun."""
        await self._begun.free(key)

    async def free_all(self, owner: str) -> None:
        """Ends all that was begun for an owner, or is being begun under a key."""
        await self._begun.free_all(owner)
        for episode_id in [i for i, live in self._live.items() if live.lease.owner == owner]:
            await self._drop(episode_id)

    def trial(self, episode_id: str) -> Episode:
        """What the trial adds to its vehicle. Asking doesn't renew the lease. Raises NotFound."""
        live = self._find(episode_id)
        return live.episode.trial(live.lease)

    def renew(self, episode_id: str) -> Episode:
        """Renews the lease; waits for no other call. Raises NotFound."""
        self._find(episode_id).lease.renew()
        return self.trial(episode_id)

    def state(self, episode_id: str) -> VehicleState:
        """The drone as it is now, also on its way. Asking doesn't renew the lease. Raises NotFound."""
        return self._find(episode_id).episode.state()

    def capabilities(self, episode_id: str) -> VehicleCapabilities:
        """Raises NotFound."""
        return self._find(episode_id).episode.capabilities()

    async def look(self, episode_id: str, cameras: Sequence[str] | None, depth: bool) -> Observation:
        """The named cameras' views of one moment; all of the rig's where none are named. Raises NotFound, BadQuestion
        or Unavailable."""
        async with self._turn(episode_id) as live:
            return await live.senses.look(cameras, depth)

    async def move(self, episode_id: str, number: int, move: Move) -> MoveResult:
        """Flies move `number` and waits for its end; a caller that stops waiting does not stop the drone. Raises
        NotFound or Conflict."""
        async with self._turn(episode_id) as live:
            done = await self._work(live.episode.begin, number, move)
            if done is not None:
                return done
            live.flight.start()
        await self._arrived(live)
        return live.episode.result(number)

    def progress(self, episode_id: str, number: int) -> MoveProgress:
        """How far the last move has come. Raises NotFound."""
        return self._find(episode_id).episode.progress(number)

    async def cancel(self, episode_id: str, number: int) -> MoveResult:
        """Stops the drone where it is on move `number`. Raises NotFound."""
        async with self._turn(episode_id) as live:
            result = live.episode.cancel(number)
            await live.flight.stop()
            return result

    async def take_off(self, episode_id: str, height_m: float) -> VehicleState:
        """Raises NotFound or Conflict."""
        return await self._flown(episode_id, lambda episode: episode.take_off(height_m))

    async def hold(self, episode_id: str) -> VehicleState:
        """Stops on the way. Raises NotFound."""
        async with self._turn(episode_id) as live:
            await live.flight.stop()
            return live.episode.state()

    async def return_home(self, episode_id: str) -> VehicleState:
        """Stops on the way first. Raises NotFound."""
        await self.hold(episode_id)
        return await self._flown(episode_id, FlyingEpisode.return_home)

    async def land(self, episode_id: str) -> VehicleState:
        """Stops on the way first. Raises NotFound."""
        await self.hold(episode_id)
        return await self._flown(episode_id, FlyingEpisode.land)

    async def claim(self, episode_id: str, claim: Claim) -> Verdict:
        """Raises NotFound, and Conflict while the drone is on its way."""
        async with self._turn(episode_id) as live:
            return await self._work(live.episode.claim, claim)

    async def end(self, episode_id: str) -> None:
        """Frees everything of it, after the call that may be running on it. Raises NotFound."""
        live = self._find(episode_id)
        async with live.turn:
            await self._drop(episode_id)

    async def expire(self) -> int:
        """Ends every episode whose lease has run out; says how many."""
        orphans = [i for i, live in self._live.items() if live.orphaned]
        for episode_id in orphans:
            await self._drop(episode_id)
        return len(orphans)

    async def close(self) -> None:
        """Ends all episodes and the worker threads."""
        for episode_id in list(self._live):
            await self._drop(episode_id)
        self._workers.shutdown(wait=True)

    async def _begin(self, question: Q) -> str:
        await self.expire()
        lease = Lease(question.owner, granted_lease_s(self.limits, question.lease_s), self._clock)
        begun = self._starting + Counter(live.lease.owner for live in self._live.values())
        check_room(self.limits, begun, question.owner)
        self._starting[question.owner] += 1
        try:
            opened = await self._open(question)
        finally:
            self._starting -= Counter([question.owner])  # owners of none are left out
        lease.renew()
        self._live[opened.episode.id] = _Live(opened, lease)
        return opened.episode.id

    async def _flown(self, episode_id: str, begin: Callable[[FlyingEpisode], None]) -> VehicleState:
        async with self._turn(episode_id) as live:
            await self._work(begin, live.episode)
            live.flight.start()
        await self._arrived(live)
        return live.episode.state()

    async def _arrived(self, live: _Live[E, S]) -> None:
        try:
            await live.flight.over()
        finally:
            live.lease.renew()

    def _find(self, episode_id: str) -> _Live[E, S]:
        live = self._live.get(episode_id)
        if live is None or live.orphaned:
            raise NotFound(
                f"there is no episode {episode_id[:40]!r}; it was never started, was ended, or nobody called it until "
                "its lease ran out; POST /v1/episodes starts one",
                code="no_such_episode",
            )
        return live

    @asynccontextmanager
    async def _turn(self, episode_id: str) -> AsyncIterator[_Live[E, S]]:
        live = self._find(episode_id)
        async with live.turn:
            self._find(episode_id)  # it may have been ended while this call waited
            try:
                yield live
            finally:
                live.lease.renew()

    async def _drop(self, episode_id: str) -> None:
        live = self._live.pop(episode_id, None)
        if live is None:
            return
        self._begun.forget(episode_id)
        await live.flight.stop()
        await live.close()

    async def _work(self, job: Callable[..., T], *arguments: object) -> T:
        return await asyncio.get_running_loop().run_in_executor(self._workers, job, *arguments)
