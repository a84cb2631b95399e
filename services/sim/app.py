"""The simulator's doors."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from typing import Annotated

from fastapi import Body, FastAPI, Path, Query, Request
from fastapi.responses import Response
from prometheus_client import Gauge

from contracts.base import Name
from contracts.sim import (
    Catalogue,
    Claim,
    Episode,
    EpisodeQuestion,
    PoseJudged,
    PoseReport,
    Truth,
    TruthQuestion,
    Verdict,
)
from contracts.vehicle import (
    Move,
    MoveProgress,
    MoveResult,
    Observation,
    TakeOff,
    VehicleCapabilities,
    VehicleState,
)
from service_kit.app import create_app, json_response
from service_kit.errors import BadQuestion, Conflict, NotFound, TooMany, error_answers
from service_kit.leaving import while_asked
from service_kit.metrics import HttpMetrics
from services.sim.episodes import Episodes
from services.sim.render.thread import RendererBusy, RenderThread

MAX_BODY_BYTES = 2 * 1024 * 1024
NOTHING_NAMED = Claim()
USUAL_HEIGHT = TakeOff()

EpisodeId = Annotated[str, Path(min_length=1, max_length=80)]
MoveNumber = Annotated[int, Path(ge=0, le=10**9)]


def build_app(
    episodes: Episodes,
    renderer: RenderThread,
    catalogue: Catalogue,
    *,
    truth: bool = False,
    token: str | None = None,
) -> FastAPI:
    """truth: whether the oracle's route answers. Ends all episodes and the renderer when the app is shut down."""
    figures = HttpMetrics()
    Gauge("sim_live_episodes", "Episodes that are live.", registry=figures.registry).set_function(lambda: episodes.live)
    Gauge("sim_scenes", "Built scenes in memory.", registry=figures.registry).set_function(lambda: episodes.scenes)

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        keeper = asyncio.create_task(_end_orphans(episodes))
        yield
        keeper.cancel()
        with suppress(asyncio.CancelledError):
            await keeper
        await episodes.close()
        await asyncio.to_thread(renderer.close)

    async def takes_work() -> str | None:
        try:
            renderer.submit(lambda _: None)
        except RendererBusy as error:
            return str(error)
        return None

    app = create_app(
        "sim",
        max_body_bytes=MAX_BODY_BYTES,
        checks={"renderer": takes_work},
        about={"renderer": renderer.name, "renderer_detail": renderer.detail, "truth": "on" if truth else "off"},
        token=token,
        metrics=figures,
        lifespan=lifespan,
    )

    @app.get("/v1/catalogue")
    async def get_catalogue() -> Catalogue:
        """Every class of object, with its colours and the places it can be put."""
        return catalogue

    _add_vehicle_routes(app, episodes)

    @app.post("/v1/episodes", status_code=201, responses=error_answers(Conflict, NotFound, TooMany))
    async def start_episode(question: EpisodeQuestion, request: Request) -> Episode:
        """A drone at the scene's start. The id can't be guessed; only who has it can fly. The same `key` again is the
        same episode; an episode whose caller leaves before it is there is not kept."""
        return await episodes.start(question, request.is_disconnected)

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

    @app.put("/v1/episodes/{episode_id}/pose", responses=error_answers(Conflict, NotFound))
    async def report_pose(episode_id: EpisodeId, report: PoseReport) -> PoseJudged:
        """Where an autopilot outside has flown the drone to: what it sees and hits there, it sees and hits here."""
        return await episodes.put(episode_id, report)

    @app.post("/v1/episodes/{episode_id}/claim", responses=error_answers(Conflict, NotFound))
    async def claim_delivery(episode_id: EpisodeId, claim: Annotated[Claim, Body()] = NOTHING_NAMED) -> Verdict:
        """Judges where the drone is now and ends the episode. The first claim counts."""
        return await episodes.claim(episode_id, claim)

    @app.post("/v1/episodes/{episode_id}/truth", responses=error_answers(NotFound))
    async def tell_truth(request: Request, episode_id: EpisodeId, question: TruthQuestion) -> Truth:
        """What is really there, where that is switched on."""
        if not truth:
            raise NotFound(
                "the truth is not told by this simulator; start it with SIM_TRUTH=on where an oracle is wanted",
                code="truth_off",
            )
        return await while_asked(request, episodes.truth(episode_id, question))

    return app


def _add_vehicle_routes(app: FastAPI, episodes: Episodes) -> None:
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


async def _end_orphans(episodes: Episodes) -> None:
    pause_s = min(5.0, max(0.05, episodes.limits.lease_s / 4))
    while True:
        await asyncio.sleep(pause_s)
        await episodes.expire()
