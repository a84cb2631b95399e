"""One worker of a subtask: a process with services of its own that is asked about one task after the other.

`python -m evaluation.subtasks.worker` reads lines from standard input: first one AskJob, then one AskOrder each. It
answers on standard output: one Ready, then one Asked an order (see evaluation.bench.worker_loop).
"""

import asyncio
import sys
from pathlib import Path

from contracts.base import Wire
from evaluation.bench.worker_loop import answer_lines
from evaluation.sim_client import SimClient, SimulatorFault
from evaluation.subtasks.figures import Subtask
from evaluation.subtasks.run import Asked, Examiner, Plan
from evaluation.task_set.task import Task
from launcher.processes import Processes, free_ports
from mission.clients import AskedVehicle, Services
from mission.ports import PortError
from service_kit.connections import Connections
from service_kit.settings import process_environment

NEEDS: dict[Subtask, tuple[str, ...]] = {
    "floors": ("sim", "vlm_gateway"),
    "recognition": ("sim", "vlm_gateway"),
    "choice": ("sim", "vlm_gateway", "depth_assist"),
    "parse": ("vlm_gateway", "llm_parser"),
}


class AskJob(Wire):
    """What a worker is told first. `environment` goes to all services on top of its own, `gateway` to that one."""

    subtask: Subtask
    plan: Plan
    logs: str
    environment: dict[str, str] = {}
    gateway: dict[str, str] = {}


class AskOrder(Wire):
    """Ask about this task."""

    task: Task


class Worker:
    """Services, and the questions put to them."""

    def __init__(self, job: AskJob) -> None:
        self._job = job
        self._group: Processes | None = None
        self._services: Services | None = None
        self._examiner: Examiner | None = None

    async def start(self) -> None:
        """Raises CannotStart."""
        job = self._job
        ports = free_ports(NEEDS[job.subtask])
        # the truth is what answers are judged by; a model is told it only where it is the oracle
        extra = {"sim": {"SIM_TRUTH": "on"}, "vlm_gateway": dict(job.gateway)}
        if job.plan.backend == "oracle" and "sim" in ports:
            extra["vlm_gateway"]["ORACLE_SIM_URL"] = f"http://127.0.0.1:{ports['sim']}"
        environment = process_environment() | job.environment
        # remembered before it is ready, so that whatever interrupts the start stops it
        self._group = Processes(ports, Path(job.logs), environment=environment, extra=extra)
        self._group.start()
        await self._group.ready()
        addresses = self._group.addresses
        tokens = Connections.read(environment).tokens
        self._services = Services(addresses, tokens)
        simulator = SimClient(addresses.sim, tokens.sim) if "sim" in ports else None
        about = AskedVehicle()
        self._examiner = Examiner(job.plan, self._services.ports(about), simulator, about)

    async def answer(self, line: bytes, gone: asyncio.Event) -> Asked | None:
        """A question that could not be put comes back as the answer's `problem`. Raises pydantic.ValidationError."""
        task = AskOrder.model_validate_json(line).task
        assert self._examiner is not None
        try:
            asked = await self._examiner.ask(self._job.subtask, task)
        except (SimulatorFault, PortError) as error:
            asked = Asked(task=task.id, problem=str(error))
        return None if gone.is_set() else asked

    async def stop(self) -> None:
        services, group = self._services, self._group
        self._services = self._group = None
        if services is not None:
            await services.close()
        if group is not None:
            await asyncio.to_thread(group.stop)


def main() -> int:
    """Returns the exit status."""
    return answer_lines("evaluation.subtasks.worker", lambda line: Worker(AskJob.model_validate_json(line)))


if __name__ == "__main__":
    sys.exit(main())
