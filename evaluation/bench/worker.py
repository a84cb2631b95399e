"""One worker of a run: a process with services of its own that flies one task after the other.

`python -m evaluation.bench.worker` reads lines from standard input: first one Job, then one Order each. It answers on
standard output: one Ready, then one EpisodeRecord an order (see evaluation.bench.worker_loop).
"""

import asyncio
import math
import shutil
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol
from uuid import uuid4, uuid5

from pydantic import Field

from contracts.base import ModelName, Wire
from contracts.orchestrator import Delivery, DeliveryQuestion, DeliveryResult, MissionSettings
from contracts.sim import EpisodeQuestion
from evaluation.bench.customer import Asked, TaskCustomer
from evaluation.bench.episode_keeping import EpisodeKeeping, Kept
from evaluation.bench.sensor_faults import SensorFaults
from evaluation.bench.task_settings import settings_of_task
from evaluation.bench.worker_loop import answer_lines
from evaluation.metrics.episode import EpisodeRecord
from evaluation.metrics.taxonomy import reason_of
from evaluation.task_set.task import Task
from launcher.processes import CannotStart, Child, Processes, free_ports
from mission.clients import Services
from mission.mission import Mission
from mission.outages import Patience
from mission.placement import InTrial, trial_question
from mission.ports import ServiceUnreachable
from mission.record import now
from mission.vehicle import Trial, Vehicle
from service_kit.addresses import FLIGHT_SERVICES
from service_kit.connections import Connections
from service_kit.settings import process_environment

END_S = 20.0
DYING_S = 2.0
"""How long a service that stopped answering may take to be gone, before it counts as running."""
AWAY_S = 30.0
"""How long an episode waits for a service or a model that is away; after one that waited in vain the next does not, so
that a model that stays away costs a run this time once, and not with every task."""
_GLANCE_S = 0.02
LEASE_S = "86400"
"""An episode that was opened ahead waits for its turn, however long the one before it takes."""


class Job(Wire):
    """What a worker is told first. `environment` goes to the services on top of its own, `sim` and `gateway` to one.
    `trajectories`: where an episode's pictures are kept, keep depth and moves too: all that every look saw."""

    folder: str
    logs: str
    mission: MissionSettings
    backend: ModelName
    environment: dict[str, str] = {}
    sim: dict[str, str] = {}
    gateway: dict[str, str] = {}
    pictures: Kept = "none"
    customer: Asked = "nobody"
    faults: SensorFaults | None = None
    trajectories: bool = False
    episode_s: float = Field(default=900.0, gt=0.0)
    away_s: float = Field(default=AWAY_S, ge=0.0)


class Order(Wire):
    """Fly `task`; `upcoming` is most likely the next one, whose scene is built meanwhile."""

    task: Task
    upcoming: Task | None = None


class Group(Protocol):
    """What of a group of services tells whether they still run."""

    def ended(self) -> Child | None: ...


async def who_ended(group: Group, patience_s: float) -> Child | None:
    """A service that runs no more; null where all do. A process that is killed closes its connections a moment before
    it is over, so that whoever finds it silent may have to wait for its end."""
    for _ in range(math.ceil(patience_s / _GLANCE_S)):
        if (ended := group.ended()) is not None:
            return ended
        await asyncio.sleep(_GLANCE_S)
    return group.ended()


@dataclass(frozen=True)
class Prefetched(InTrial):
    """A trial that may have been begun before its turn (`opening`); once its drone is placed, `begin_next` begins the
    next one: building a scene takes as long as several looks, and the simulator would idle meanwhile."""

    opening: asyncio.Task[Vehicle] | None
    begin_next: Callable[[], None]

    async def begin(self, key: str) -> Vehicle:
        if self.opening is not None:
            await asyncio.wait({self.opening})  # whatever came of it: the same key is the same trial
        vehicle = await super().begin(key)
        self.begin_next()
        return vehicle


class Worker:
    """Services, and the flights through them."""

    def __init__(self, job: Job) -> None:
        self._job = job
        self._group: Processes | None = None
        self._services: Services | None = None
        self._starts = 0
        self._session = uuid4()
        self._opening: asyncio.Task[Vehicle] | None = None
        self._away = False

    async def start(self) -> None:
        """Fresh services on free ports. Raises CannotStart."""
        await self.stop()
        job = self._job
        ports = free_ports(FLIGHT_SERVICES)
        gateway = {"ORACLE_SIM_URL": f"http://127.0.0.1:{ports['sim']}"} if job.backend == "oracle" else {}
        sim = {"SIM_TRUTH": "on"} if job.backend == "oracle" else {}
        self._starts += 1
        self._session = uuid4()
        environment = process_environment() | job.environment
        group = Processes(
            ports,
            Path(job.logs) / str(self._starts),
            environment=environment,
            extra={
                "sim": {"SIM_LEASE_S": LEASE_S} | sim | job.sim,
                "vlm_gateway": gateway | job.gateway,
            },
        )
        # remembered before it is ready, so that whatever interrupts the start stops it
        self._group = group
        group.start()
        await group.ready()
        self._services = Services(group.addresses, Connections.read(environment).tokens)

    async def stop(self) -> None:
        services, group = self._services, self._group
        self._services = self._group = None
        if self._opening is not None:
            self._opening.cancel()
            await asyncio.wait({self._opening})
            self._opening = None
        if services is not None:
            await services.close()
        if group is not None:
            await asyncio.to_thread(group.stop)

    async def answer(self, line: bytes, gone: asyncio.Event) -> EpisodeRecord | None:
        """Raises pydantic.ValidationError for a line that is no Order."""
        return await self.fly(Order.model_validate_json(line), gone)

    async def fly(self, order: Order, gone: asyncio.Event) -> EpisodeRecord | None:
        """The task's record, whatever happened; null when `gone` was set meanwhile."""
        task = order.task
        started, began = now(), time.perf_counter()
        result: DeliveryResult | None = None
        error: str | None = None
        infrastructure = False
        folder = self._record_folder(task)
        customer = TaskCustomer(task) if self._job.customer == "task" else None
        try:
            if self._services is None or self._group is None or self._group.ended() is not None:
                await self.start()
            assert self._services is not None
            result = await self._flown(self._services, order, folder, customer, gone)
            if gone.is_set():
                return None
            if result is None:
                error = f"the episode took longer than {self._job.episode_s:g} s"
                await self.start()
        except CannotStart as cause:
            error, infrastructure = f"the services could not be started: {cause}", True
        except ServiceUnreachable as cause:
            error, infrastructure = str(cause), True
        except Exception as cause:
            error = f"{type(cause).__name__}: {cause}"
        reason = "unreachable" if infrastructure else reason_of(task, result)
        if error is None and self._group is not None:
            ended = await who_ended(self._group, DYING_S if reason == "unreachable" else 0.0)
            if ended is not None:
                error = f"{ended.name} ended with code {ended.process.returncode} during the episode"
                reason = "unreachable" if reason == "error" else reason
        if error is None and reason == "error" and result is not None:
            error = result.message
        self._away = reason == "unreachable"
        if folder is not None and self._job.pictures == "failures" and reason == "success":
            shutil.rmtree(folder, ignore_errors=True)
            folder = None
        return EpisodeRecord(
            task=task.id,
            reason=reason,
            result=result,
            error=error,
            started=started,
            wall_s=round(time.perf_counter() - began, 4),
            render_s=round(result.timings_s.get("render", 0.0), 4) if result else 0.0,
            model_s=round(sum(c.seconds for c in result.model_calls.values()), 4) if result else 0.0,
            folder=f"episodes/{task.id}" if folder is not None else None,
            questions=customer.asked if customer is not None else 0,
        )

    async def _flown(
        self,
        services: Services,
        order: Order,
        folder: Path | None,
        customer: TaskCustomer | None,
        gone: asyncio.Event,
    ) -> DeliveryResult | None:
        """Null where it took too long, or `gone` was set. Raises ServiceUnreachable where the disk takes no more."""
        task, settings = order.task, self._settings(order.task)
        with EpisodeKeeping(
            folder, _delivery(task, folder), self._asked(task, settings), trajectory=self._job.trajectories
        ) as kept:
            simulated = services.simulated()
            placement = self._placement(simulated.trial, order, services.trial())
            placed, patience = kept.placement(placement), self._patience
            mission = Mission(simulated.ports, placed, settings, kept.log, customer=customer, patience=patience)
            flight = asyncio.create_task(mission.fly(task.request, self._key(task)))
            leaving = asyncio.create_task(gone.wait())
            done, _ = await asyncio.wait(
                {flight, leaving}, timeout=self._job.episode_s, return_when=asyncio.FIRST_COMPLETED
            )
            leaving.cancel()
            if flight not in done:
                flight.cancel()
                await asyncio.wait({flight}, timeout=END_S)
                return None
            result = flight.result()
            kept.conclude(result)
            return result

    @property
    def _patience(self) -> Patience:
        return Patience(
            0.0 if self._away else self._job.away_s, lambda: self._group is None or self._group.ended() is not None
        )

    def _key(self, task: Task) -> str:
        """Of the task's trial in these services."""
        return uuid5(self._session, task.id).hex

    def _placement(self, trial: Trial, order: Order, next_trial: Trial) -> Prefetched:
        def begin_next() -> None:
            if (task := order.upcoming) is not None:
                question = self._question(task).model_copy(update={"key": self._key(task)})
                self._opening = asyncio.create_task(next_trial.begin(question))

        opening, self._opening = self._opening, None
        return Prefetched(trial, self._question(order.task), opening, begin_next)

    def _question(self, task: Task) -> EpisodeQuestion:
        return trial_question(task.scene, self._settings(task))

    def _settings(self, task: Task) -> MissionSettings:
        return settings_of_task(self._job.mission, self._job.backend, task, self._job.faults)

    def _record_folder(self, task: Task) -> Path | None:
        if self._job.pictures == "none":
            return None
        return Path(self._job.folder) / "episodes" / task.id

    def _asked(self, task: Task, settings: MissionSettings) -> DeliveryQuestion:
        return DeliveryQuestion(request=task.request, scene=task.scene, backend=self._job.backend, settings=settings)


def _delivery(task: Task, folder: Path | None) -> Delivery:
    return Delivery(
        id=task.id,
        status="waiting",
        phase="parse",
        request=task.request,
        scene=task.scene.name,
        created=now(),
        folder=None if folder is None else str(folder),
    )


def main() -> int:
    """Returns the exit status."""
    return answer_lines("evaluation.bench.worker", lambda line: Worker(Job.model_validate_json(line)))


if __name__ == "__main__":
    sys.exit(main())
