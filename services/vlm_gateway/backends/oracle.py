"""The truth, asked of the simulator: for upper bounds, and for telling faults of flying from faults of seeing.

It looks at no picture; it needs the name of the simulator's vehicle that took them. Never cached: the drone moves
between two identical questions. A simulator that does not answer is a service that is unavailable, not a model that
failed: who asks waits for it as for any other service.
"""

import math
from typing import TypeVar

from pydantic import BaseModel

from contracts.cameras import Camera
from contracts.geometry import Point3, Pose
from contracts.sim import Truth, TruthQuestion, TruthView
from contracts.vehicle import VehicleState
from contracts.vlm_gateway import ORACLE_VEHICLE_HEADER, MarkedPoint, Match
from service_kit.client import Garbled, Refused, ServiceClient, Unreachable
from service_kit.errors import BadQuestion, Unavailable
from services.vlm_gateway.backends.base import (
    Building,
    BuildingAsk,
    Direction,
    DirectionAsk,
    Floors,
    FloorsAsk,
    Kind,
    ObjectAsk,
    Reply,
    Sightings,
    asked_vehicle,
)
from services.vlm_gateway.backends.noise import Count, Faults
from services.vlm_gateway.errors import ModelUnreachable
from services.vlm_gateway.model_configs import OracleModelConfig

A = TypeVar("A", bound=BaseModel)
WHOLE_COUNT, BUILDING_BOX, WHOLE_LOOK = "0", "1000", "2000"
"""Beside the views' directions: the faults of a question that is not about one view of a look."""
FOCAL_PX, MAX_SIDE_PX = 400.0, 1600
_ABOUT = 0.15
DECLINED = "declined, as the oracle's noise wants it"


class OracleBackend:
    """`config` says when an object counts as seen, and how wrong to be on purpose."""

    kind: Kind = "oracle"
    cacheable = False
    model = "oracle"

    def __init__(self, sim: ServiceClient, config: OracleModelConfig) -> None:
        self._sim = sim
        self._config = config

    @property
    def fingerprint(self) -> dict[str, object]:
        return {}

    async def preflight(self, phrase: str | None) -> str | None:
        return None

    async def count_floors(self, ask: FloorsAsk) -> Reply[Floors]:
        truth = await self._truth(_asked_vehicle(), (_known(ask.camera),))
        faults = Faults(self._config.noise, truth, "floors", WHOLE_COUNT)
        if faults.refuses:
            return Reply("refused", text=DECLINED)
        view = truth.views[0]
        rows = tuple(sorted(min(1.0, max(0.0, row)) for row in view.floor_rows))  # topmost first
        return Reply("answered", Floors(*faults.miscounted(Count(view.floors_visible, rows))))

    async def find_building(self, ask: BuildingAsk) -> Reply[Building]:
        truth = await self._truth(_asked_vehicle(), (_known(ask.camera),))
        faults = Faults(self._config.noise, truth, "floors", BUILDING_BOX)
        if faults.refuses:
            return Reply("refused", text=DECLINED)
        box = truth.views[0].building_box
        return Reply("answered", Building(faults.jittered(box) if box is not None else None))

    async def find_object(self, ask: ObjectAsk) -> Reply[Sightings]:
        """The goal object, whatever the phrase: what the customer meant is known here."""
        cameras = tuple(view.camera for view in ask.views)
        truth = await self._truth(_asked_vehicle(), cameras)
        noise = self._config.noise
        look = Faults(noise, truth, "recognition", WHOLE_LOOK)
        if look.refuses:
            return Reply("refused", text=DECLINED)
        matches = []
        for camera, view in zip(cameras, truth.views, strict=True):
            faults = Faults(noise, truth, "recognition", _direction_of(camera))
            matches += [
                m.model_copy(update={"box": faults.jittered(m.box)}) for m in self._seen(view) if not faults.misses
            ]
        false = look.false_match(truth.views) if look.claims_falsely else None
        if false is not None:
            matches.append(false)
        return Reply("answered", Sightings(tuple(sorted(matches, key=lambda match: -match.confidence))))

    async def choose_direction(self, ask: DirectionAsk) -> Reply[Direction]:
        """The point from whose safe end the way to the goal is shortest."""
        vehicle = _asked_vehicle()
        pose = (await self._call("GET", f"/v1/episodes/{vehicle}", VehicleState)).pose
        ends = tuple(end_of(point, ask.camera, pose) for point in ask.points)
        truth = await self._truth(vehicle, (), candidates=ends)
        if Faults(self._config.noise, truth, "choice", _direction_of(ask.camera)).refuses:
            return Reply("refused", text=DECLINED)
        ways = [(way_m, at) for at, way_m in enumerate(truth.remaining_m[: len(ask.points)]) if way_m is not None]
        if not ways:
            return Reply("refused", text="no way leads from any of the points to the goal")
        return Reply("answered", Direction(ask.points[min(ways)[1]].label))

    def status(self) -> dict[str, object]:
        return {"sim": self._sim.url}

    async def close(self) -> None:
        await self._sim.close()

    def _seen(self, view: TruthView) -> list[Match]:
        return [
            Match(camera=view.camera, box=thing.box, confidence=min(1.0, max(0.0, thing.share)))
            for thing in view.objects
            if thing.goal
            and thing.share >= self._config.min_share
            and thing.pixels >= self._config.min_pixels
            and thing.distance_m <= self._config.max_distance_m
        ]

    async def _truth(
        self,
        vehicle: str,
        cameras: tuple[Camera, ...],
        *,
        candidates: tuple[Point3, ...] = (),
    ) -> Truth:
        question = TruthQuestion(cameras=tuple(map(sharp, cameras)), candidates=candidates)
        truth = await self._call("POST", f"/v1/episodes/{vehicle}/truth", Truth, question)
        if len(truth.views) != len(cameras) or len(truth.remaining_m) < len(candidates):
            raise ModelUnreachable("the simulator's truth is incomplete", details={"reason": "contract"})
        return truth

    async def _call(self, method: str, path: str, answer: type[A], question: TruthQuestion | None = None) -> A:
        try:
            return await self._sim.call(method, path, answer, question, timeout_s=self._config.timeout_s)
        except Refused as error:
            if error.status == 404:
                message = f"the simulator has no such episode, or its truth is switched off: {error.reason}"
                raise BadQuestion(message, code="no_truth") from None
            if error.status == 429 or error.status >= 500:
                raise Unavailable(f"the oracle's simulator: {error.message}") from None
            raise ModelUnreachable(f"the simulator answers {error.status}: {error.reason}") from None
        except Unreachable as error:
            raise Unavailable(f"the oracle's simulator: {error.message}") from None
        except Garbled as error:
            raise ModelUnreachable(f"the oracle's simulator: {error.message}") from None


def sharp(camera: Camera) -> Camera:
    """The same camera with pixels about as fine as the default rig's, so that thresholds in pixels mean the same
    whatever size the pictures have."""
    finer = FOCAL_PX / camera.fx_px
    if abs(finer - 1.0) <= _ABOUT:
        return camera
    return camera.scaled_to(min(MAX_SIDE_PX, round(finer * max(camera.width, camera.height))))


def end_of(point: MarkedPoint, camera: Camera, pose: Pose) -> Point3:
    """Where the drone would stand after flying towards `point`: metres, ENU, at its own height.

    The marked column lies `atan((x W - c_x) / f_x)` right of the view's axis; yaw runs counter-clockwise, headings
    clockwise.
    """
    right = math.radians(camera.heading_deg) + math.atan((point.x * camera.width - camera.cx_px) / camera.fx_px)
    course = pose.yaw - right
    return Point3(
        x=pose.x + point.distance_m * math.cos(course), y=pose.y + point.distance_m * math.sin(course), z=pose.z
    )


def _direction_of(camera: Camera) -> str:
    """Where a view looks, for its faults: cameras that look the same way err the same way."""
    return f"{camera.heading_deg:g}" + (f"/{camera.pitch_deg:g}" if camera.pitch_deg else "")


def _known(camera: Camera | None) -> Camera:
    if camera is None:
        raise BadQuestion("the oracle needs 'camera', what took the picture: it looks for itself", code="no_camera")
    return camera


def _asked_vehicle() -> str:
    vehicle = asked_vehicle.get()
    if vehicle is None:
        raise BadQuestion(
            f"the oracle needs the header {ORACLE_VEHICLE_HEADER}: the name of the simulator's vehicle that took the "
            "pictures, which is the id of its episode",
            code="no_oracle_vehicle",
        )
    return vehicle
