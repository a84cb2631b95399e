"""Deliveries carried on by a new process at every step, each step's first process killed on its way."""

import asyncio
import contextlib
import multiprocessing
import os
import signal
from pathlib import Path

import pytest

from contracts.orchestrator import DeliveryQuestion, DeliveryResult, MissionSettings
from mission.advance import advance
from mission.clients import Services
from mission.policies import policy_of
from mission.record import Record, read_events, read_state
from mission.state import begin
from mission.step import MissionContext
from orchestrator.delivery import Order, Run
from service_kit.addresses import Addresses

SETTINGS = MissionSettings(image_size=400)
PROCESSES = multiprocessing.get_context("forkserver")
PROCESSES.set_forkserver_preload([__name__])
STEP_S = 60.0


def one_step(folder: Path, at: Addresses) -> None:
    """What a process does that knows the record's folder and nothing else."""
    asyncio.run(_one_step(folder, at))


async def _one_step(folder: Path, at: Addresses) -> None:
    order = Order.recorded(folder)
    record = Record.reopened(folder)
    with contextlib.closing(record):
        async with Services(at) as services:
            record.keep(await advance(read_state(folder) or begin(order.request), _context(order, services, record)))


def _context(order: Order, services: Services, record: Record) -> MissionContext:
    ports, trial = services.simulated()
    return MissionContext(ports, order.placed(trial), order.settings, policy_of(order.settings.viewpoint), record)


def run_step(folder: Path, at: Addresses, *, kill_after_s: float | None) -> None:
    """One process, to its end or to its death."""
    process = PROCESSES.Process(target=one_step, args=(folder, at))
    process.start()
    process.join(kill_after_s if kill_after_s is not None else STEP_S)
    if process.is_alive() and process.pid is not None:
        with contextlib.suppress(ProcessLookupError):  # it may end by itself meanwhile
            os.kill(process.pid, signal.SIGKILL)
        process.join(STEP_S)
    if kill_after_s is None:
        assert process.exitcode == 0


def without_clocks(result: DeliveryResult) -> DeliveryResult:
    calls = {role: c.model_copy(update={"seconds": 0.0, "latencies_s": ()}) for role, c in result.model_calls.items()}
    return result.model_copy(update={"timings_s": {}, "model_calls": calls})


@pytest.mark.slow
@pytest.mark.parametrize("sample", ["green-flower-pot", "villa-teddy-bear", "tower-watering-can"])
async def test_a_delivery_whose_process_dies_at_every_step_ends_as_if_none_had(
    at: Addresses, runs: Path, sample: str
) -> None:
    order = Order(DeliveryQuestion(sample=sample, backend="oracle", settings=SETTINGS))
    async with Services(at) as services:
        whole = Run(order, runs)
        expected = await whole.fly(services.simulated())
        assert expected.outcome == "delivered"
        cut = Run(order, runs)
        cut.record.close()
        folder, steps, done_twice = cut.record.folder, 0, 0
        while (state := read_state(folder)) is None or not state.over:
            steps, told = steps + 1, len(read_events(folder))
            # killed a little later each time: now before the flight, now after it, now after it was written
            await asyncio.to_thread(run_step, folder, at, kill_after_s=0.05 + 0.03 * (steps % 12))
            if read_state(folder) == state:
                done_twice += len(read_events(folder)) > told
                await asyncio.to_thread(run_step, folder, at, kill_after_s=None)
        result = await Run.reopened(folder).fly(services.simulated())
    assert without_clocks(result) == without_clocks(expected)
    assert done_twice > 0, "no process died between its first event and the writing of its state"
    told = [(e.number, e.kind, e.message) for e in read_events(folder)]
    assert told == [(e.number, e.kind, e.message) for e in read_events(whole.record.folder)]
