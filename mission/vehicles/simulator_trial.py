"""A trial in the simulator: a drone in a scene, and the judge of its claim, over HTTP."""

import asyncio
from collections.abc import Callable
from contextlib import suppress
from weakref import ReferenceType, ref

from contracts.geometry import Point3
from contracts.sim import Claim, Episode, EpisodeQuestion, Verdict
from mission.reached import reached
from mission.vehicles.http_vehicle import HttpVehicle
from service_kit.client import CallError, Refused, ServiceClient

RENEWALS_A_LEASE = 3
RENEW_DEADLINE_S = 10.0
OnBoard = Callable[[str], None]
"""Is told the name of the vehicle that was begun or resumed."""


class SimulatorTrial:
    """`client`: of a simulator. One trial at a time where `on_board` listens. `owner`: for whom trials are begun."""

    def __init__(self, client: ServiceClient, on_board: OnBoard | None = None, owner: str | None = None) -> None:
        self._client = client
        self._on_board = on_board
        self._owner = owner

    async def begin(self, question: EpisodeQuestion) -> HttpVehicle:
        question = question.model_copy(update={"owner": self._owner})
        try:
            episode = await reached(self._client.call("POST", "/v1/episodes", Episode, question))
        except asyncio.CancelledError:
            with suppress(CallError):
                await self._client.delete(f"/v1/episodes?key={question.key}")
            raise
        return self._boarded(episode)

    async def resume(self, vehicle: str) -> HttpVehicle:
        return self._boarded(await reached(self._client.call("POST", f"/v1/episodes/{vehicle}/renew", Episode)))

    async def renderer(self, vehicle: str) -> str | None:
        return (await reached(self._client.call("GET", f"/v1/episodes/{vehicle}/trial", Episode))).renderer

    async def claim(self, vehicle: str, target: Point3 | None) -> Verdict:
        path = f"/v1/episodes/{vehicle}/claim"
        return await reached(self._client.call("POST", path, Verdict, Claim(target=target)))

    def _boarded(self, episode: Episode) -> HttpVehicle:
        if self._on_board is not None:
            self._on_board(episode.id)
        return HeldVehicle(self._client, episode)


class HeldVehicle(HttpVehicle):
    """A simulator's vehicle, held by its lease until it is released or nobody has this object any more."""

    def __init__(self, client: ServiceClient, episode: Episode) -> None:
        super().__init__(client, episode.id, f"/v1/episodes/{episode.id}")
        every_s = episode.lease_s / RENEWALS_A_LEASE
        self._renewing = asyncio.create_task(_renew(ref(self), client, f"{self._base}/renew", every_s))

    async def release(self) -> None:
        self._renewing.cancel()
        await super().release()


async def _renew(vehicle: ReferenceType[HeldVehicle], client: ServiceClient, path: str, every_s: float) -> None:
    """Until the vehicle or its episode is gone. A simulator that does not answer is asked again: whoever flies the
    vehicle is told by the calls of the flight."""
    while True:
        await asyncio.sleep(every_s)
        if vehicle() is None:
            return
        try:
            await client.call("POST", path, Episode, timeout_s=RENEW_DEADLINE_S)
        except Refused as error:
            if error.status == 404:
                return
        except CallError:
            continue
