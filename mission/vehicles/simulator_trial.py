"""A trial in the simulator: a drone in a scene, and the judge of its claim, over HTTP."""

import asyncio
from collections.abc import Callable
from contextlib import suppress

from contracts.cameras import Rig
from contracts.geometry import Point3
from contracts.scene import Scene
from contracts.sim import Claim, Episode, EpisodeQuestion, Flight, Verdict
from mission.reached import reached
from mission.vehicles.http_vehicle import HttpVehicle
from service_kit.client import CallError, ServiceClient

OnBoard = Callable[[str], None]
"""Is told the name of the vehicle that was begun or resumed."""


class SimulatorTrial:
    """`client`: of a simulator. One trial at a time where `on_board` listens."""

    def __init__(self, client: ServiceClient, on_board: OnBoard | None = None) -> None:
        self._client = client
        self._on_board = on_board

    async def begin(self, key: str, scene: Scene, flight: Flight, rig: Rig) -> HttpVehicle:
        question = EpisodeQuestion(scene=scene, flight=flight, rig=rig, key=key)
        try:
            episode = await reached(self._client.call("POST", "/v1/episodes", Episode, question))
        except asyncio.CancelledError:
            with suppress(CallError):
                await self._client.delete(f"/v1/episodes?key={key}")
            raise
        return self._boarded(episode)

    async def resume(self, vehicle: str) -> HttpVehicle:
        return self._boarded(await self.episode(vehicle))

    async def episode(self, vehicle: str) -> Episode:
        """What the simulator adds to the vehicle: scene, renderer, flight, when it expires. Raises PortError."""
        return await reached(self._client.call("GET", f"/v1/episodes/{vehicle}/trial", Episode))

    async def renderer(self, vehicle: str) -> str | None:
        return (await self.episode(vehicle)).renderer

    async def claim(self, vehicle: str, target: Point3 | None) -> Verdict:
        path = f"/v1/episodes/{vehicle}/claim"
        return await reached(self._client.call("POST", path, Verdict, Claim(target=target)))

    def _boarded(self, episode: Episode) -> HttpVehicle:
        if self._on_board is not None:
            self._on_board(episode.id)
        return HttpVehicle(self._client, episode.id, f"/v1/episodes/{episode.id}")
