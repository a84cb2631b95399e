"""What the durable engine costs a mission: the same deliveries flown with it and without it, in turns.

    python -m tests.load.bench_engine --deliveries 5 --image-size 800

Without: a mission in this process, with a record on the disk. With: the same over REST, by an orchestrator on SQLite or
on `--database`. Both use the same services, with the oracle for a model, so that little else takes time.
"""

import argparse
import asyncio
import statistics
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

from contracts.events import Event
from contracts.orchestrator import DeliveryQuestion, MissionSettings
from launcher.processes import Processes, free_ports, oracle_settings
from mission.clients import Services
from mission.record import read_events
from orchestrator.delivery import Order, Run
from service_kit.addresses import FLIGHT_SERVICES
from service_kit.settings import process_environment
from tests.system.orchestrator_process import OrchestratorProcess, heard


class Took(NamedTuple):
    """Seconds from the drone's placing to the result, and from the post to the result; and how many events."""

    mission_s: float
    all_s: float
    events: int


def mission_s(events: list[Event]) -> float:
    placed = next(event for event in events if event.kind == "placed")
    return events[-1].time_s - placed.time_s


async def without(question: DeliveryQuestion, at: Processes, runs: Path) -> Took:
    async with Services(at.addresses) as services:
        began = time.perf_counter()
        run = Run(Order(question), runs)
        await run.fly(services.simulated())
        took = time.perf_counter() - began
    events = read_events(run.record.folder)
    return Took(mission_s(events), took, len(events))


def with_engine(question: DeliveryQuestion, orchestrator: OrchestratorProcess) -> Took:
    began = time.perf_counter()
    events = heard(orchestrator, orchestrator.post(**question.model_dump(mode="json", exclude_unset=True)))
    return Took(mission_s(events), time.perf_counter() - began, len(events))


def say(how: str, took: list[Took]) -> float:
    """The median mission, in seconds."""
    mission = statistics.median(one.mission_s for one in took)
    post_to_result = statistics.median(one.all_s for one in took)
    sys.stdout.write(
        f"{how}: {mission:.2f} s from placing to result ({took[0].events} events), "
        f"{post_to_result:.2f} s from post to result\n"
    )
    sys.stdout.flush()
    return mission


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--deliveries", type=int, default=5)
    parser.add_argument("--sample", default="villa-teddy-bear")
    parser.add_argument("--backend", default="oracle")
    parser.add_argument("--image-size", type=int, default=800)
    parser.add_argument("--database", help="postgresql://...; SQLite without it")
    asked = parser.parse_args()
    settings = MissionSettings(image_size=asked.image_size)
    question = DeliveryQuestion(sample=asked.sample, backend=asked.backend, settings=settings)
    ports = free_ports(FLIGHT_SERVICES)
    extra = oracle_settings(ports)
    extra["vlm_gateway"] |= {"CACHE_MODE": "off"}
    with tempfile.TemporaryDirectory() as folder:
        services = Processes(ports, Path(folder) / "logs", environment=process_environment(), extra=extra)
        database = {} if asked.database is None else {"DATABASE_URL": asked.database}
        orchestrator = OrchestratorProcess(services.addresses, Path(folder) / "runs", database)
        try:
            services.start()
            asyncio.run(services.ready())
            orchestrator.start()
            plain: list[Took] = []
            durable: list[Took] = []
            for _ in range(asked.deliveries + 1):  # the first of each warms up
                plain.append(asyncio.run(without(question, services, Path(folder) / "plain")))
                durable.append(with_engine(question, orchestrator))
        finally:
            orchestrator.kill()
            services.stop()
    base, more = say("without the engine", plain[1:]), say("with the engine", durable[1:])
    sys.stdout.write(f"a mission takes {100 * (more / base - 1):+.1f} %\n")


if __name__ == "__main__":
    main()
