"""A trial in software in the loop: a scene of the simulator, laid about the vehicle where it stands.

The routes and the lease are the simulator's own (contracts.sim), so that whoever asks a simulator for a trial may ask
this service. One drone flies one trial at a time. When it is over, or nobody has called for as long as its lease, the
vehicle lands where it is.
"""

import asyncio
import logging
import time
from collections.abc import Callable
from contextlib import suppress
from typing import NamedTuple

from contracts.geometry import Pose
from contracts.sim import Claim, Episode, EpisodeQuestion, Verdict
from episode_kit.begun import asked_for
from episode_kit.lease import Lease
from service_kit.client import CallError, Refused
from service_kit.errors import Conflict, NotFound, ServiceError, TooMany, Unavailable
from services.mavlink_vehicle.cameras.simulated import SimulatedCameras
from services.mavlink_vehicle.course import FlightLimits
from services.mavlink_vehicle.flight_ends import Interrupted
from services.mavlink_vehicle.link import CommandRefused, LinkLost
from services.mavlink_vehicle.simulator import Simulator
from services.mavlink_vehicle.task import Body, Task
from services.mavlink_vehicle.vehicle import Vehicle

log = logging.getLogger("mavlink_vehicle.trial")

REPORT_EVERY_S = 0.1
REPORT_GROUNDED_EVERY_S = 5.0
ABOVE_GROUND_M = 0.02
"""So little does a vehicle on the ground not touch it."""
LANDS_AGAIN_S = 2.0


class Terms(NamedTuple):
    """What bounds every trial of this vehicle. `lease_s`: seconds without a call until a trial is over."""

    limits: FlightLimits
    reserve: float
    lease_s: float


class _Live:
    """The trial under way."""

    def __init__(self, question: EpisodeQuestion, episode: Episode, lease: Lease, cameras: SimulatedCameras) -> None:
        self.question = question
        self.episode = episode
        self.cameras = cameras
        self.lease = lease
        self.claimed: Verdict | None = None
        self.reporting: asyncio.Task[None] | None = None


class Trials:
    """`simulator`: draws and judges."""

    def __init__(self, vehicle: Vehicle, simulator: Simulator, terms: Terms) -> None:
        self._vehicle = vehicle
        self._simulator = simulator
        self._terms = terms
        self._idle = vehicle.task
        self._live: _Live | None = None
        self._beginning: tuple[EpisodeQuestion, asyncio.Task[_Live]] | None = None
        self._landing: asyncio.Task[None] | None = None

    async def run(self) -> None:
        """Ends trials that nobody flies any more, until it is cancelled."""
        while True:
            live = self._live
            if live is not None and live.lease.over and not self._vehicle.busy:
                log.warning("nobody has called for %g s: the trial %s is over", live.lease.lease_s, live.episode.id)
                await self.end(live.episode.id)
            await asyncio.sleep(min(1.0, self._terms.lease_s / 4.0))

    async def close(self) -> None:
        """The simulator's episode is freed; the vehicle does what its own failsafe says."""
        await self._stop_beginning()
        if self._live is not None:
            await self._forget(self._live)
        if self._landing is not None:
            self._landing.cancel()
        await self._simulator.close()

    async def simulator_usable(self) -> str | None:
        """Null where the simulator is ready and takes our token."""
        return await self._simulator.client.usable()

    async def begin(self, question: EpisodeQuestion) -> Episode:
        """The same key and question again is the same trial. Raises Conflict, TooMany, Unavailable, and what the
        simulator refuses."""
        if self._beginning is None:
            live = self._live
            if live is not None and _same(live.question, question):
                live.lease.renew()
                return self.trial(live.episode.id)
            if live is not None:
                self._must_differ(live.question, question)
                raise TooMany(
                    f"this vehicle flies the trial {live.episode.id}; one at a time",
                    code="too_many_episodes",
                    details={"max_episodes": 1},
                )
            self._beginning = (question, asyncio.create_task(self._begun(question)))
        asked, beginning = self._beginning
        if not _same(asked, question):
            raise TooMany("this vehicle begins another trial; one at a time", code="too_many_episodes")
        try:
            live = await asyncio.shield(beginning)
        except asyncio.CancelledError:
            if not beginning.cancelled():
                raise  # the caller leaves, and the trial is begun all the same
            raise NotFound("the trial was ended before it had begun", code="no_such_episode") from None
        finally:
            if beginning.done() and self._beginning == (asked, beginning):
                self._beginning = None
        return self.trial(live.episode.id)

    async def free(self, key: str) -> None:
        """Ends the trial that was begun, or is being begun, under this key."""
        await self._free(lambda question: question.key == key)

    async def free_all(self, owner: str) -> None:
        """Ends the trial that was begun, or is being begun, for this owner."""
        await self._free(lambda question: question.owner == owner)

    async def _free(self, is_meant: Callable[[EpisodeQuestion], bool]) -> None:
        if self._beginning is not None and is_meant(self._beginning[0]):
            await self._stop_beginning()
        if self._live is not None and is_meant(self._live.question):
            await self.end(self._live.episode.id)

    def found(self, episode_id: str) -> Vehicle:
        """The vehicle of that trial; its lease is renewed. Raises NotFound."""
        self._find(episode_id).lease.renew()
        return self._vehicle

    def trial(self, episode_id: str) -> Episode:
        """What the trial adds to its vehicle. Raises NotFound, Unavailable."""
        live = self._find(episode_id)
        return live.episode.model_copy(
            update={
                "status": "flying" if live.claimed is None else "claimed",
                "vehicle": self._vehicle.state(),
                "lease_s": live.lease.lease_s,
                "expires_in_s": live.lease.left_s,
            }
        )

    def renew(self, episode_id: str) -> Episode:
        """Raises NotFound, Unavailable."""
        self.found(episode_id)
        return self.trial(episode_id)

    async def claim(self, episode_id: str, claim: Claim) -> Verdict:
        """Judged where the vehicle is now. Raises NotFound, Conflict, Unavailable."""
        live = self._find(episode_id)
        live.lease.renew()
        if live.claimed is None:
            if self._vehicle.busy:
                raise Conflict("claiming has to wait: the vehicle is on its way", code="move_under_way")
            await self._stop_reporting(live)
            try:
                await live.cameras.put(self._pose(), grounded=self._vehicle.grounded)
                live.claimed = await self._simulator.claim(episode_id, claim)
            except CallError as error:
                self._report(live)
                raise Unavailable(f"nobody judges: {error}", code="no_judge") from None
        return live.claimed

    async def end(self, episode_id: str) -> None:
        """The trial is over, and the vehicle lands. Raises NotFound."""
        live = self._find(episode_id)
        self._over()
        await self._forget(live)

    def _over(self) -> None:
        """Nobody flies the trial any more."""
        self._live = None
        self._landing = asyncio.create_task(self._idle_again())

    async def _idle_again(self) -> None:
        await self._vehicle.begin(self._idle)
        await self._landed()

    async def _stop_beginning(self) -> None:
        if self._beginning is not None:
            beginning, self._beginning = self._beginning[1], None
            beginning.cancel()
            await asyncio.wait({beginning})

    async def _begun(self, question: EpisodeQuestion) -> _Live:
        if self._landing is not None:
            await asyncio.wait({self._landing})
        drone = self._vehicle.drone
        drone.control.leave()  # whatever went wrong in a mission before is over, unless a pilot flies it still
        if drone.telemetry.in_air:
            await self._landed(tries=1)
        if drone.telemetry.in_air:
            raise Unavailable("the vehicle is in the air, and does not land; land it", code="in_the_air")
        try:
            await drone.ready()
        except (CommandRefused, LinkLost, Interrupted) as error:
            raise Unavailable(str(error), code="not_ready") from None
        episode = await self._simulator.begin(question)
        flight, start, terms = question.flight, question.scene.start, self._terms
        stands_m = flight.radius_m + ABOVE_GROUND_M
        foot = Pose(x=start.position.x, y=start.position.y, z=stands_m, yaw=start.yaw)
        cameras = SimulatedCameras(self._simulator.client, episode.id, question.rig.cameras)
        limits = terms.limits._replace(
            speed_m_s=min(terms.limits.speed_m_s, flight.max_speed_m_s),
            acceleration_m_s2=min(terms.limits.acceleration_m_s2, flight.max_acceleration_m_s2),
            yaw_rate_rad_s=min(terms.limits.yaw_rate_rad_s, flight.max_yaw_rate_rad_s),
        )
        body = Body(flight.radius_m, stands_m, terms.reserve)
        await self._vehicle.begin(Task(episode.id, cameras, limits, body, foot))
        lease = Lease(question.owner, question.lease_s or terms.lease_s, time.monotonic)
        live = _Live(question, episode, lease, cameras)
        self._live = live
        self._report(live)
        return live

    def _report(self, live: _Live) -> None:
        live.reporting = asyncio.create_task(self._report_poses(live))

    async def _report_poses(self, live: _Live) -> None:
        """Tells the simulator where the vehicle is, and the vehicle what it has hit there."""
        vehicle = self._vehicle
        while True:
            with suppress(Unavailable):
                try:
                    judged = await live.cameras.put(self._pose(), grounded=vehicle.grounded)
                except CallError as error:
                    if isinstance(error, Refused) and error.status == 404:
                        log.warning("the simulator has forgotten the scene: the trial %s is over", live.episode.id)
                        if self._live is live:
                            self._over()
                        return
                    log.warning("the simulator does not judge: %s", error)
                else:
                    if judged.hit is not None and vehicle.collided is None:
                        vehicle.collided = judged.hit
                        vehicle.drone.hit = judged.hit if vehicle.busy else None
            moving = vehicle.busy or vehicle.drone.telemetry.in_air
            await asyncio.sleep(REPORT_EVERY_S if moving else REPORT_GROUNDED_EVERY_S)

    def _pose(self) -> Pose:
        return self._vehicle.state().pose

    async def _stop_reporting(self, live: _Live) -> None:
        if live.reporting is not None:
            live.reporting.cancel()
            await asyncio.gather(live.reporting, return_exceptions=True)

    async def _forget(self, live: _Live) -> None:
        await self._stop_reporting(live)
        await self._simulator.end(live.episode.id)

    async def _landed(self, tries: int = 30) -> None:
        """Lands, unless somebody else flies it; tried again where the autopilot does not hear."""
        for _ in range(tries):
            if not self._vehicle.drone.telemetry.in_air:
                return
            try:
                await self._vehicle.land()
            except Conflict as error:
                log.warning("it is not landed: %s", error)
                return
            except ServiceError as error:
                log.warning("it is not landed yet: %s", error)
                await asyncio.sleep(LANDS_AGAIN_S)

    def _find(self, episode_id: str) -> _Live:
        live = self._live
        if live is None or live.episode.id != episode_id:
            raise NotFound(
                f"there is no episode {episode_id[:40]!r}; it was never started, was ended, or nobody called it until "
                "its lease ran out; POST /v1/episodes starts one",
                code="no_such_episode",
            )
        return live

    def _must_differ(self, live: EpisodeQuestion, question: EpisodeQuestion) -> None:
        if question.key is not None and live.key == question.key:
            raise Conflict(
                f"another trial was begun under the key {question.key}; send the same question again, or choose "
                "another key",
                code="key_differs",
            )


def _same(a: EpisodeQuestion, b: EpisodeQuestion) -> bool:
    return a.key is not None and asked_for(a) == asked_for(b)
