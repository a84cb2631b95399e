"""Cameras in software in the loop: the simulator draws what they would see from where the autopilot says it is, and
judges what the vehicle hits on its way."""

import asyncio
import time
from collections.abc import Sequence

from contracts.cameras import Camera
from contracts.geometry import Pose
from contracts.sim import PoseJudged, PoseReport
from contracts.vehicle import Observation
from service_kit.client import CallError, ServiceClient
from service_kit.errors import Unavailable
from services.mavlink_vehicle.cameras.port import PoseAt, Seen

POSE_DEADLINE_S = 15.0
LOOK_DEADLINE_S = 55.0


class NoCameras:
    """Of a vehicle whose cameras are simulated, while there is no scene to be seen."""

    carried: tuple[Camera, ...] = ()

    async def look(self, chosen: Sequence[Camera], pose_at: PoseAt, *, depth: bool) -> Seen:
        raise Unavailable(
            "the cameras of this vehicle are simulated, and there is no scene: POST /v1/episodes begins a trial",
            code="no_scene",
        )


class SimulatedCameras:
    """Of one episode of the simulator at `client`."""

    def __init__(self, client: ServiceClient, episode: str, carried: tuple[Camera, ...]) -> None:
        self.carried = carried
        self._client = client
        self._base = f"/v1/episodes/{episode}"
        self._turn = asyncio.Lock()

    async def put(self, pose: Pose, *, grounded: bool) -> PoseJudged:
        """The vehicle is there now. Raises CallError."""
        async with self._turn:
            return await self._put(pose, grounded=grounded)

    async def look(self, chosen: Sequence[Camera], pose_at: PoseAt, *, depth: bool) -> Seen:
        """Raises Unavailable where the simulator does not draw, NoPose."""
        wanted = {"cameras": ",".join(camera.name for camera in chosen)} | ({} if depth else {"depth": "false"})
        async with self._turn:
            time_s = time.monotonic()
            pose = pose_at(time_s)
            try:
                await self._put(pose, grounded=True)
                seen = await self._client.call(
                    "GET", f"{self._base}/observation", Observation, params=wanted, timeout_s=LOOK_DEADLINE_S
                )
            except CallError as error:
                raise Unavailable(f"no pictures: {error}", code="no_pictures") from None
        return Seen(seen.views, time_s, pose, seen.timings_s)

    async def _put(self, pose: Pose, *, grounded: bool) -> PoseJudged:
        report = PoseReport(pose=pose, grounded=grounded)
        return await self._client.call("PUT", f"{self._base}/pose", PoseJudged, report, timeout_s=POSE_DEADLINE_S)
