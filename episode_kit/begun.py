"""Which episodes were begun for whom: the same key is the same episode, and what nobody waits for is not kept."""

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from contracts.sim import EpisodeTerms
from service_kit.errors import Conflict, NotFound

Q = TypeVar("Q", bound=EpisodeTerms)
Left = Callable[[], Awaitable[bool]]
"""Whether the caller has closed its connection."""


@dataclass
class Begun(Generic[Q]):
    """An episode that is being begun, or was. `task` brings its id; `waiting` callers wait for it; one of those who
    were still there got it: `taken`."""

    question: Q
    task: asyncio.Task[str]
    waiting: int = 0
    taken: bool = False


class BegunEpisodes(Generic[Q]):
    """`begin` makes an episode and brings its id; `end` frees one that may be gone already."""

    def __init__(self, begin: Callable[[Q], Awaitable[str]], end: Callable[[str], Awaitable[None]]) -> None:
        self._begin = begin
        self._end = end
        self._by_key: dict[str, Begun[Q]] = {}

    async def begin(self, question: Q, left: Left) -> str:
        """The id of the episode of this question, begun now or before under the same key. Where every caller has left
        meanwhile it is freed again. Raises Conflict for another question under a key, and what `begin` raises."""
        begun = self._begun(question)
        begun.waiting += 1
        try:
            episode_id = await asyncio.shield(begun.task)
            gone = await left()
            begun.taken = begun.taken or not gone
        finally:
            begun.waiting -= 1  # only now: while one caller is asked whether he left, another may have come
        if gone and not begun.taken and begun.waiting == 0:
            self.forget(episode_id)
            await self._end(episode_id)
            raise NotFound("the caller left before its episode was begun", code="no_such_episode")
        return episode_id

    async def free(self, key: str) -> None:
        """Ends the episode that was begun under a key, or that is being begun as soon as it is there. An unknown key
        is no error: nothing is kept under it."""
        begun = self._by_key.pop(key, None)
        if begun is None:
            return
        try:
            episode_id = await asyncio.shield(begun.task)
        except Exception:  # it was refused, and whoever asked is told: nothing was begun
            return
        await self._end(episode_id)

    async def free_all(self, owner: str) -> None:
        """`free` for every key of an owner."""
        for key in [key for key, begun in self._by_key.items() if begun.question.owner == owner]:
            await self.free(key)

    def forget(self, episode_id: str) -> None:
        """The episode is over: its key is free again."""
        gone = [key for key, begun in self._by_key.items() if _brought(begun) == episode_id]
        for key in gone:
            del self._by_key[key]

    def _begun(self, question: Q) -> Begun[Q]:
        key = question.key
        known = self._by_key.get(key) if key is not None else None
        if known is not None and asked_for(known.question) != asked_for(question):
            raise Conflict(
                f"another episode was begun under the key {key}; send the same question again, or choose another key",
                code="key_differs",
            )
        if known is None:
            known = Begun(question, asyncio.ensure_future(self._made(question)))
            if key is not None:
                self._by_key[key] = known
        return known

    async def _made(self, question: Q) -> str:
        try:
            return await self._begin(question)
        except BaseException:
            if question.key is not None:
                self._by_key.pop(question.key, None)
            raise


def asked_for(question: Q) -> Q:
    """What makes an episode the same: for whom it is begun may change, where another process goes on."""
    return question.model_copy(update={"owner": None, "lease_s": None})


def _brought(begun: Begun[Q]) -> str | None:
    task = begun.task
    return task.result() if task.done() and not task.cancelled() and task.exception() is None else None
