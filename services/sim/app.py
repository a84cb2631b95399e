"""The simulator's doors."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from fastapi import FastAPI, Request
from prometheus_client import Gauge

from contracts.sim import Catalogue, Episode, EpisodeQuestion, PoseJudged, PoseReport, Truth, TruthQuestion
from episode_kit.routes import EpisodeId, add_trial_routes, add_vehicle_routes, kept
from service_kit.app import create_app
from service_kit.errors import Conflict, NotFound, TooMany, error_answers
from service_kit.leaving import while_asked
from service_kit.metrics import HttpMetrics
from services.sim.episodes import Episodes
from services.sim.render.thread import RendererBusy, RenderThread

MAX_BODY_BYTES = 2 * 1024 * 1024


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
        async with kept(episodes):
            yield
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

    add_vehicle_routes(app, episodes)
    add_trial_routes(app, episodes)

    @app.post("/v1/episodes", status_code=201, responses=error_answers(Conflict, NotFound, TooMany))
    async def start_episode(question: EpisodeQuestion, request: Request) -> Episode:
        """A drone at the scene's start. The id can't be guessed; only who has it can fly. The same `key` again is the
        same episode; an episode whose caller leaves before it is there is not kept."""
        return await episodes.start(question, request.is_disconnected)

    @app.put("/v1/episodes/{episode_id}/pose", responses=error_answers(Conflict, NotFound))
    async def report_pose(episode_id: EpisodeId, report: PoseReport) -> PoseJudged:
        """Where an autopilot outside has flown the drone to: what it sees and hits there, it sees and hits here."""
        return await episodes.put(episode_id, report)

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
