"""The live episode of a CARLA server. It has one world and one clock, so one drone flies in it at a time."""

import asyncio
import secrets
import time

from contracts.sim import EpisodeQuestion
from episode_kit.episodes import LiveEpisodes, Opened
from episode_kit.lease import Clock
from episode_kit.limits import Limits
from services.carla_world.client import CarlaClient
from services.carla_world.episode import CarlaEpisode, check
from services.carla_world.rig import CarlaSenses
from services.carla_world.scene_documents import SceneDocuments

AT_A_TIME = 1


class CarlaEpisodes(LiveEpisodes[EpisodeQuestion, CarlaEpisode, CarlaSenses]):
    """Leaves CARLA running by itself when it is closed."""

    def __init__(
        self,
        client: CarlaClient,
        documents: SceneDocuments,
        lease_s: float,
        max_lease_s: float,
        clock: Clock = time.monotonic,
    ) -> None:
        super().__init__(Limits(max_episodes=AT_A_TIME, lease_s=lease_s, max_lease_s=max_lease_s), clock)
        self._client = client
        self._documents = documents

    async def problem(self) -> str | None:
        """Why CARLA can't be flown in now."""
        return await asyncio.to_thread(self._client.problem)

    async def close(self) -> None:
        await super().close()
        await asyncio.to_thread(self._client.leave)

    async def _open(self, question: EpisodeQuestion) -> Opened[CarlaEpisode, CarlaSenses]:
        check(question)
        document = self._documents.find(question.scene.name)
        episode = await self._work(CarlaEpisode, secrets.token_hex(16), self._client, document, question)

        async def close() -> None:
            await self._work(episode.close)

        return Opened(episode, CarlaSenses(episode, episode.rig_in_world), close)
