"""The doors of a CARLA server's world: those of the simulator, but for what only that has."""

from fastapi import FastAPI, Request
from prometheus_client import Gauge

from contracts.sim import Episode, EpisodeQuestion
from episode_kit.routes import add_trial_routes, add_vehicle_routes, kept
from service_kit.app import create_app
from service_kit.errors import Conflict, NotFound, TooMany, error_answers
from service_kit.metrics import HttpMetrics
from services.carla_world.client import RELEASE
from services.carla_world.episodes import CarlaEpisodes

MAX_BODY_BYTES = 2 * 1024 * 1024


def build_app(episodes: CarlaEpisodes, server: str, token: str | None = None) -> FastAPI:
    """`server`: CARLA's address, for people. Ends all episodes when the app is shut down."""
    figures = HttpMetrics()
    live = Gauge("carla_live_episodes", "Episodes that are live.", registry=figures.registry)
    live.set_function(lambda: episodes.live)

    app = create_app(
        "carla_world",
        max_body_bytes=MAX_BODY_BYTES,
        checks={"carla": episodes.problem},
        about={"carla": server, "release": RELEASE},
        token=token,
        metrics=figures,
        lifespan=lambda _: kept(episodes),
    )
    add_vehicle_routes(app, episodes)
    add_trial_routes(app, episodes)

    @app.post("/v1/episodes", status_code=201, responses=error_answers(Conflict, NotFound, TooMany))
    async def start_episode(question: EpisodeQuestion, request: Request) -> Episode:
        """A drone at the start of a scene that lies on one of CARLA's maps (`CARLA_SCENES`). The same `key` again is
        the same episode; an episode whose caller leaves before it is there is not kept."""
        return await episodes.start(question, request.is_disconnected)

    return app
