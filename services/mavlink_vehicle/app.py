"""The doors of mavlink_vehicle: the vehicle's contract at `/v1/vehicle`, and, where the simulator draws, the trial's
routes at `/v1/episodes`, which are the simulator's own."""

from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Annotated

from fastapi import Body, FastAPI, Query, Request
from fastapi.responses import Response

from contracts.sim import Episode, EpisodeQuestion
from contracts.vehicle import (
    Move,
    MoveProgress,
    MoveResult,
    Observation,
    TakeOff,
    VehicleCapabilities,
    VehicleState,
)
from episode_kit.routes import USUAL_HEIGHT, EpisodeId, MoveNumber, add_trial_routes
from service_kit.app import Check, create_app, json_response
from service_kit.errors import Conflict, NotFound, TooMany, Unavailable, error_answers
from service_kit.leaving import while_asked
from services.mavlink_vehicle.cameras.filmed import FilmedCameras
from services.mavlink_vehicle.link import Link
from services.mavlink_vehicle.loops import Loops
from services.mavlink_vehicle.release import AfterMission, Release
from services.mavlink_vehicle.trial import Trials
from services.mavlink_vehicle.vehicle import Vehicle

MAX_BODY_BYTES = 2 * 1024 * 1024
OWN = "/v1/vehicle"
OF_TRIAL = "/v1/episodes/{episode_id}"

VehicleOf = Callable[[Request], Vehicle]


def build_app(
    vehicle: Vehicle,
    *,
    trials: Trials | None = None,
    filmed: FilmedCameras | None = None,
    after_mission: AfterMission = "hold",
    token: str | None = None,
) -> FastAPI:
    """`trials`: where a simulator draws; `filmed`: where the vehicle has cameras of its own. Listens to the autopilot
    while the app is up."""
    link, release, loops = vehicle.drone.link, Release(vehicle, after_mission), Loops()
    checks: dict[str, Check] = {"autopilot": lambda: _ready(link), "loops": loops.problem}
    checks |= {"sim": trials.simulator_usable} if trials is not None else {}
    checks |= {"cameras": filmed.problem} if filmed is not None else {}

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        await link.start()
        if filmed is not None:
            filmed.start()
        loops.start({"the stream of set-points": vehicle.drone.run(), "the count of flight time": vehicle.run()})
        if trials is not None:
            loops.start({"the watch over leases": trials.run()})
        yield
        await loops.close()
        if trials is not None:
            await trials.close()
        await release.close()
        await vehicle.close()
        await link.close()
        if filmed is not None:
            await filmed.close()

    app = create_app(
        "mavlink_vehicle",
        max_body_bytes=MAX_BODY_BYTES,
        checks=checks,
        about={"cameras": "its own" if filmed is not None else "simulated", "autopilot_address": link.address},
        token=token,
        lifespan=lifespan,
    )
    _add_vehicle_routes(app, OWN, lambda _: vehicle)

    @app.delete(OWN, status_code=204)
    async def release_vehicle() -> None:
        """The mission needs it no more; what it does then is a setting."""
        await release.begin()

    if trials is not None:
        _add_vehicle_routes(app, OF_TRIAL, lambda request: trials.found(request.path_params["episode_id"]))
        _add_trial_routes(app, trials)
    return app


async def _ready(link: Link) -> str | None:
    telemetry = link.telemetry
    if telemetry.lost:
        return link.silence
    if telemetry.missing and not telemetry.armed:
        return f"it lacks {', '.join(telemetry.missing)}{telemetry.last_words}"
    return None


def _add_vehicle_routes(app: FastAPI, base: str, vehicle_of: VehicleOf) -> None:
    """The vehicle's contract (`contracts.vehicle`)."""

    @app.get(base, responses=error_answers(NotFound, Unavailable))
    async def get_state(request: Request) -> VehicleState:
        """Where the drone is, also on its way, and how far it has come."""
        return vehicle_of(request).state()

    @app.get(f"{base}/capabilities", responses=error_answers(NotFound))
    async def get_capabilities(request: Request) -> VehicleCapabilities:
        """What the drone is and which cameras it carries."""
        return vehicle_of(request).capabilities()

    @app.get(f"{base}/observation", response_model=Observation, responses=error_answers(NotFound, Unavailable))
    async def observe(
        request: Request,
        cameras: Annotated[str | None, Query(max_length=1500, description="names by commas; all without it")] = None,
        depth: bool = True,
    ) -> Response:
        """Pictures, and depth unless `depth=false`, of one moment."""
        names = None if cameras is None else tuple(name.strip() for name in cameras.split(","))
        return json_response(await while_asked(request, vehicle_of(request).observe(names, depth=depth)))

    @app.post(f"{base}/take-off", responses=error_answers(Conflict, NotFound, Unavailable))
    async def take_off(request: Request, question: Annotated[TakeOff, Body()] = USUAL_HEIGHT) -> VehicleState:
        """Waits until the autopilot is ready, arms, rises; a drone that flies stays where it is."""
        return await vehicle_of(request).take_off(question.height_m)

    @app.put(f"{base}/moves/{{n}}", responses=error_answers(Conflict, NotFound, Unavailable))
    async def move_drone(request: Request, n: MoveNumber, move: Move) -> MoveResult:
        """Move number `n`, counted from 1. Sent again with the same body it is answered again and not flown again."""
        return await vehicle_of(request).move(n, move)

    @app.get(f"{base}/moves/{{n}}", responses=error_answers(NotFound))
    async def get_progress(request: Request, n: MoveNumber) -> MoveProgress:
        """How far the last move has come."""
        return vehicle_of(request).progress(n)

    @app.delete(f"{base}/moves/{{n}}", responses=error_answers(Conflict, NotFound))
    async def cancel_move(request: Request, n: MoveNumber) -> MoveResult:
        """Stops the drone on its way; a move that is over stays what it is. The next number is used up unflown."""
        return await vehicle_of(request).cancel(n)

    @app.post(f"{base}/hold", responses=error_answers(Conflict, NotFound, Unavailable))
    async def hold(request: Request) -> VehicleState:
        """Stops the drone on its way."""
        return await vehicle_of(request).hold()

    @app.post(f"{base}/return", responses=error_answers(Conflict, NotFound, Unavailable))
    async def return_home(request: Request) -> VehicleState:
        """By the autopilot's own way to where it took off, there it holds. A move under way is cancelled."""
        return await vehicle_of(request).return_home()

    @app.post(f"{base}/land", responses=error_answers(Conflict, NotFound, Unavailable))
    async def land(request: Request) -> VehicleState:
        """Straight down. A move under way is cancelled."""
        return await vehicle_of(request).land()


def _add_trial_routes(app: FastAPI, trials: Trials) -> None:
    @app.post("/v1/episodes", status_code=201, responses=error_answers(Conflict, TooMany, Unavailable))
    async def start_trial(question: EpisodeQuestion) -> Episode:
        """A scene about the drone, which stands under its start. The same `key` again is the same trial."""
        return await trials.begin(question)

    add_trial_routes(app, trials)

    @app.delete(OF_TRIAL, status_code=204, responses=error_answers(NotFound))
    async def end_trial(episode_id: EpisodeId) -> None:
        """The trial is over, and the drone lands where it is."""
        await trials.end(episode_id)
