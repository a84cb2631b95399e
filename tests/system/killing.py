"""Deliveries flown undisturbed, and the same while the orchestrators that fly them are killed again and again."""

import contextlib
import random
import threading
import time
from collections import deque
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

from contracts.events import Event
from contracts.orchestrator import DeliveryResult
from tests.system.orchestrator_process import OrchestratorProcess, heard, without_clocks

Question = dict[str, object]
SMALL: Question = {"sample": "villa-teddy-bear", "backend": "oracle", "settings": {"image_size": 160}}
SHORT: Question = SMALL | {"settings": {"image_size": 96, "max_exploration_steps": 1}}
"""Ends after one look round the building."""
OTHERS_TAKE_OVER_S = 4.0
"""Those that are told to take the dead for dead after two seconds."""
LISTENERS = 16
"""Deliveries that are listened to at a time, the oldest first: those that fly, and some that wait."""


def three_hundred() -> list[Question]:
    """Most of them short."""
    return [SMALL if k % 10 == 0 else SHORT for k in range(300)]


def fly_while_killed(
    processes: Sequence[OrchestratorProcess],
    runs: Path,
    questions: Sequence[Question],
    kills: int,
    chance: random.Random,
) -> int:
    """The questions are posted to the first two processes, all of them fly, and random ones are killed; how many
    deliveries were not done after the last kill."""
    first, second = processes[0], processes[:2][-1]
    undisturbed: dict[str, tuple[DeliveryResult, list[tuple[str, str]]]] = {}
    for question in questions:
        if repr(question) not in undisturbed:
            name = first.post(**question)
            told = [(e.kind, e.message) for e in heard(second, name)]
            undisturbed[repr(question)] = without_clocks(second.delivery(name).result), told
    before = {delivery.id for delivery in first.deliveries()}
    takers = [(first, second)[k % 2] for k in range(len(questions))]
    names = [taker.post(**question) for taker, question in zip(takers, questions, strict=True)]
    # each is heard at the orchestrator that has not taken it, where there are two
    hearers = [first if taker is second else second for taker in takers]
    to_hear = deque(zip(names, hearers, strict=True))
    listened: dict[str, list[Event]] = {}

    def listen() -> None:
        with contextlib.suppress(IndexError):
            while True:
                name, at = to_hear.popleft()
                listened[name] = heard(at, name, within_s=7200.0)

    listeners = [threading.Thread(target=listen, daemon=True) for _ in range(LISTENERS)]
    for listener in listeners:
        listener.start()
    kill_again_and_again(processes, kills, chance)
    left = len(names) - len(listened)
    for listener in listeners:
        listener.join()
    for name, question in zip(names, questions, strict=True):
        delivery = first.delivery(name)
        assert delivery == second.delivery(name)
        expected, told = undisturbed[repr(question)]
        assert without_clocks(delivery.result) == expected
        assert delivery.flights == 1, "the drone went on where it was"
        events = listened[name]
        assert [e.number for e in events] == list(range(1, len(events) + 1))
        assert [(e.kind, e.message) for e in events] == told
        recorded = (runs / name / "events.jsonl").read_text().splitlines()
        assert [e.model_dump_json() for e in events] == recorded
    for process in processes:
        assert {delivery.id for delivery in process.deliveries()} == before | set(names)
    return left


def kill_again_and_again(processes: Sequence[OrchestratorProcess], kills: int, chance: random.Random) -> None:
    """Each time one of those that answer; it is started again at once, or after the others have taken over. Returns
    when all answer."""
    pauses = [0.0] if len(processes) == 1 else [0.0, OTHERS_TAKE_OVER_S]
    starting: dict[OrchestratorProcess, Future[None]] = {}
    with ThreadPoolExecutor(len(processes)) as starters:
        for _ in range(kills):
            time.sleep(chance.uniform(0.05, 2.0))
            while len(starting) == len(processes) and not any(start.done() for start in starting.values()):
                time.sleep(0.1)
            answering = [process for process in processes if process not in starting or starting[process].done()]
            victim = chance.choice(answering)
            if victim in starting:
                starting.pop(victim).result()
            victim.kill()
            starting[victim] = starters.submit(_start_after, victim, chance.choice(pauses))
        for start in starting.values():
            start.result()


def _start_after(process: OrchestratorProcess, seconds: float) -> None:
    time.sleep(seconds)
    process.start()
