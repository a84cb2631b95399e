"""The simulator's doors."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from typing import Annotated

from fastapi import Body, FastAPI, Path, Query
from fastapi.responses import Response
from prometheus_client import Gauge

from contracts.geometry import VIEW_HEADINGS_DEG, Heading
from contracts.sim import (
    Catalogue,
    Claim,
    Episode,
    EpisodeQuestion,
    Move,
    MoveResult,
    Observation,
    Truth,
    TruthQuestion,
    Verdict,
)
from service_kit.app import create_app, json_response
from service_kit.errors import BadQuestion, NotFound
from service_kit.metrics import HttpMetrics
from services.sim.episodes import Episodes
from services.sim.render.thread import RendererBusy, RenderThread

MAX_BODY_BYTES = 2 * 1024 * 1024
ALL_VIEWS = ",".join(str(heading) for heading in VIEW_HEADINGS_DEG)
NOTHING_NAMED = Claim()

EpisodeId = Annotated[str, Path(min_length=1, max_length=80)]


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
        keeper = asyncio.create_task(_give_up_idle(episodes))
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

    @app.post("/v1/episodes", status_code=201)
    async def start_episode(question: EpisodeQuestion) -> Episode:
        """A drone at the scene's start. The id can't be guessed; only who has it can fly."""
        return await episodes.start(question)

    @app.get("/v1/episodes/{episode_id}")
    async def get_episode(episode_id: EpisodeId) -> Episode:
        """Where the drone is and how far it has come. Asking doesn't keep an episode alive."""
        return episodes.state(episode_id)

    @app.get("/v1/episodes/{episode_id}/observation", response_model=Observation)
    async def observe(
        episode_id: EpisodeId,
        views: Annotated[str, Query(max_length=40, description="headings in degrees, by commas")] = ALL_VIEWS,
        size: Annotated[int, Query(ge=64, le=1600, description="pixels, square")] = 800,
        depth: bool = True,
    ) -> Response:
        """RGB pictures, and depth unless `depth=false`, of one moment."""
        return json_response(await episodes.look(episode_id, headings(views), size, depth))

    @app.put("/v1/episodes/{episode_id}/moves/{n}")
    async def move_drone(episode_id: EpisodeId, n: Annotated[int, Path(ge=0, le=10**9)], move: Move) -> MoveResult:
        """Move number `n`, counted from 1. Sent again with the same body it is answered again and not flown again."""
        return await episodes.move(episode_id, n, move)

    @app.post("/v1/episodes/{episode_id}/claim")
    async def claim_delivery(episode_id: EpisodeId, claim: Annotated[Claim, Body()] = NOTHING_NAMED) -> Verdict:
        """Judges where the drone is now and ends the episode. The first claim counts."""
        return await episodes.claim(episode_id, claim)

    @app.post("/v1/episodes/{episode_id}/truth")
    async def tell_truth(episode_id: EpisodeId, question: TruthQuestion) -> Truth:
        """What is really there, where that is switched on."""
        if not truth:
            raise NotFound(
                "the truth is not told by this simulator; start it with SIM_TRUTH=on where an oracle is wanted",
                code="truth_off",
            )
        return await episodes.truth(episode_id, question)

    @app.delete("/v1/episodes/{episode_id}", status_code=204)
    async def end_episode(episode_id: EpisodeId) -> None:
        """Frees all that the episode holds."""
        await episodes.end(episode_id)

    return app


def headings(views: str) -> tuple[Heading, ...]:
    """`-90,0,45` as headings, in the order asked for. Raises BadQuestion."""
    known = {str(heading): heading for heading in VIEW_HEADINGS_DEG}
    asked = [view.strip().removeprefix("+") for view in views.split(",")]
    wrong = next((view for view in asked if view not in known), None)
    if wrong is not None:
        raise BadQuestion(
            f"views={views}: there is no view {wrong!r}; choose from {', '.join(known)}, separated by commas",
            code="bad_views",
        )
    if len(set(asked)) != len(asked):
        raise BadQuestion(f"views={views}: ask for each view once", code="bad_views")
    return tuple(known[view] for view in asked)


async def _give_up_idle(episodes: Episodes) -> None:
    pause_s = min(5.0, max(0.05, episodes.limits.idle_s / 4))
    while True:
        await asyncio.sleep(pause_s)
        await episodes.expire()
