"""Episodes by key while callers come and go."""

import asyncio

import pytest

from contracts.sim import EpisodeQuestion
from episode_kit.begun import BegunEpisodes
from service_kit.errors import NotFound
from tests.mission.block import Block, block_scene

QUESTION = EpisodeQuestion(scene=block_scene(Block()), key="k")


class Made:
    """Counts what was begun and ended."""

    def __init__(self) -> None:
        self.begun: list[str] = []
        self.ended: list[str] = []
        self.episodes = BegunEpisodes(self._begin, self._end)

    async def _begin(self, question: EpisodeQuestion) -> str:
        self.begun.append(f"e{len(self.begun) + 1}")
        return self.begun[-1]

    async def _end(self, episode: str) -> None:
        self.ended.append(episode)


async def stays() -> bool:
    await asyncio.sleep(0)
    return False


async def test_what_every_caller_has_left_is_freed_and_its_key_begins_another() -> None:
    made = Made()

    async def gone() -> bool:
        return True

    with pytest.raises(NotFound):
        await made.episodes.begin(QUESTION, gone)
    assert made.ended == ["e1"]
    assert await made.episodes.begin(QUESTION, stays) == "e2"


@pytest.mark.parametrize("turns", range(6))
async def test_a_caller_who_comes_while_another_is_found_to_have_left_keeps_the_episode(turns: int) -> None:
    """`turns`: how many turns of the event loop it takes to find that out."""
    made = Made()
    second: list[asyncio.Task[str]] = []

    async def gone() -> bool:
        second.append(asyncio.create_task(made.episodes.begin(QUESTION, stays)))
        for _ in range(turns):
            await asyncio.sleep(0)
        return True

    first = await asyncio.gather(made.episodes.begin(QUESTION, gone), return_exceptions=True)
    got = await second[0]
    assert got not in made.ended, first
    assert await made.episodes.begin(QUESTION, stays) == got
