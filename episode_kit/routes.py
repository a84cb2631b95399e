"""The doors of a world's episodes: the vehicle's contract (`contracts.vehicle`), and the trial's beside it."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from typing import Annotated, Any, Protocol

from fastapi import Body, FastAPI, Path, Query, Request
from fastapi.responses import Response

from contracts.base import Name
from contracts.sim import Claim, Episode, Verdict
from contracts.vehicle import (
    Move,
    MoveProgress,
    MoveResult,
    Observation,
    TakeOff,
    VehicleCapabilities,
    VehicleState,
)
from episode_kit.episodes import LiveEpisodes
from service_kit.app import json_response
from service_kit.errors import BadQuestion, Conflict, NotFound, error_answers
from service_kit.leaving import while_asked

NOTHING_NAMED = Claim()
USUAL_HEIGHT = TakeOff()

EpisodeId = Annotated[str, Path(min_length=1, max_length=80)]
MoveNumber = Annotated[int, Path(ge=0, le=10**9)]


class Trials(Protocol):
    """Whose trials are asked for: a world's episodes, or a vehicle's own in a scene."""

    async def free(self, key: str) -> None: ...

    async def free_all(self, owner: str) -> None: ...

    def trial(self, episode_id: str) -> Episode: ...

    def renew(self, episode_id: str) -> Episode: ...

    async def claim(self, episode_id: str, claim: Claim) -> Verdict: ...


def add_trial_routes(app: FastAPI, episodes: Trials) -> None:
    """All but `POST /v1/episodes`, whose question is each world's own."""

    @app.delete("/v1/episodes", status_code=204)
    async def free_episodes(key: Name | None = None, owner: Name | None = None) -> None:
        """Ends the episode that was begun, or is being begun, under this key, or all of this owner; where there are
        none that is no error."""
        if (key is None) == (owner is None):
            raise BadQuestion("name either a key or an owner: DELETE /v1/episodes?key=<key>")
        if key is not None:
            await episodes.free(key)
        if owner is not None:
            await episodes.free_all(owner)

    @app.get("/v1/episodes/{episode_id}/trial", responses=error_answers(NotFound))
    async def get_trial(episode_id: EpisodeId) -> Episode:
        """The scene, who draws it, whether it was claimed, when it expires. Asking doesn't renew the lease."""
        return episodes.trial(episode_id)

    @app.post("/v1/episodes/{episode_id}/renew", responses=error_answers(NotFound))
    async def renew_lease(episode_id: EpisodeId) -> Episode:
        """A sign of life. Looks, moves and the other calls that do something renew the lease as well."""
        return episodes.renew(episode_id)

    @app.post("/v1/episodes/{episode_id}/claim", responses=error_answers(Conflict, NotFound))
    async def claim_delivery(episode_id: EpisodeId, claim: Annotated[Claim, Body()] = NOTHING_NAMED) -> Verdict:
        """Judges where the drone is now and ends the episode. The first claim counts."""
        return await episodes.claim(episode_id, claim)


def add_vehicle_routes(app: FastAPI, episodes: LiveEpisodes[Any, Any, Any]) -> None:
    """The vehicle's contract (`contracts.vehicle`); its base address is the episode's."""
    base = "/v1/episodes/{episode_id}"

    @app.get(base, responses=error_answers(NotFound))
    async def get_state(episode_id: EpisodeId) -> VehicleState:
        """Where the drone is, also on its way, and how far it has come. Asking doesn't renew the lease."""
        return episodes.state(episode_id)

    @app.get(f"{base}/capabilities", responses=error_answers(NotFound))
    async def get_capabilities(episode_id: EpisodeId) -> VehicleCapabilities:
        """What the drone is and which cameras it carries."""
        return episodes.capabilities(episode_id)

    @app.get(f"{base}/observation", response_model=Observation, responses=error_answers(NotFound))
    async def observe(
        request: Request,
        episode_id: EpisodeId,
        cameras: Annotated[str | None, Query(max_length=1500, description="names by commas; all without it")] = None,
        depth: bool = True,
    ) -> Response:
        """Pictures, and depth unless `depth=false`, of one moment; not drawn where the caller has left."""
        names = None if cameras is None else tuple(name.strip() for name in cameras.split(","))
        return json_response(await while_asked(request, episodes.look(episode_id, names, depth)))

    @app.post(f"{base}/take-off", responses=error_answers(Conflict, NotFound))
    async def take_off(episode_id: EpisodeId, question: Annotated[TakeOff, Body()] = USUAL_HEIGHT) -> VehicleState:
        """Straight up from where it stands; a drone that flies stays where it is."""
        return await episodes.take_off(episode_id, question.height_m)

    @app.put(f"{base}/moves/{{n}}", responses=error_answers(Conflict, NotFound))
    async def move_drone(episode_id: EpisodeId, n: MoveNumber, move: Move) -> MoveResult:
        """Move number `n`, counted from 1. Sent again with the same body it is answered again and not flown again."""
        return await episodes.move(episode_id, n, move)

    @app.get(f"{base}/moves/{{n}}", responses=error_answers(NotFound))
    async def get_progress(episode_id: EpisodeId, n: MoveNumber) -> MoveProgress:
        """How far the last move has come."""
        return episodes.progress(episode_id, n)

    @app.delete(f"{base}/moves/{{n}}", responses=error_answers(Conflict, NotFound))
    async def cancel_move(episode_id: EpisodeId, n: MoveNumber) -> MoveResult:
        """Stops the drone on its way; a move that is over stays what it is. The next number is used up unflown."""
        return await episodes.cancel(episode_id, n)

    @app.post(f"{base}/hold", responses=error_answers(Conflict, NotFound))
    async def hold(episode_id: EpisodeId) -> VehicleState:
        """Stops the drone on its way."""
        return await episodes.hold(episode_id)

    @app.post(f"{base}/return", responses=error_answers(Conflict, NotFound))
    async def return_home(episode_id: EpisodeId) -> VehicleState:
        """Over all roofs to where it started, there it holds. A move under way is cancelled."""
        return await episodes.return_home(episode_id)

    @app.post(f"{base}/land", responses=error_answers(Conflict, NotFound))
    async def land(episode_id: EpisodeId) -> VehicleState:
        """Straight down. A move under way is cancelled."""
        return await episodes.land(episode_id)

    @app.delete(base, status_code=204, responses=error_answers(NotFound))
    async def end_episode(episode_id: EpisodeId) -> None:
        """Frees all that the episode holds."""
        await episodes.end(episode_id)


@asynccontextmanager
async def kept(episodes: LiveEpisodes[Any, Any, Any]) -> AsyncIterator[None]:
    """Meanwhile ends episodes whose leases have run out; at the end all of them."""
    keeper = asyncio.create_task(_end_orphans(episodes))
    yield
    keeper.cancel()
    with suppress(asyncio.CancelledError):
        await keeper
    await episodes.close()


async def _end_orphans(episodes: LiveEpisodes[Any, Any, Any]) -> None:
    """Until it is cancelled: ends episodes whose leases have run out."""
    pause_s = min(5.0, max(0.05, episodes.limits.lease_s / 4))
    while True:
        await asyncio.sleep(pause_s)
        await episodes.expire()
