"""Deliveries through all services as real processes on real HTTP."""

import asyncio
import dataclasses
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import httpx
import pytest

from contracts.events import Event
from contracts.geometry import Point3
from contracts.orchestrator import DeliveryQuestion, DeliveryResult, MissionSettings
from contracts.scene import FreePlace, SceneObject
from launcher.processes import free_ports
from mission.clients import Services
from mission.record import read_events
from orchestrator import sample_library
from orchestrator.delivery import Order, Run
from service_kit.addresses import FLIGHT_SERVICES, Addresses
from tests.ending import WITH_THE_TESTS

SMALL = MissionSettings(image_size=320)
SAMPLE = "green-flower-pot"


async def fly(services: Services, runs: Path, **question: object) -> tuple[DeliveryResult, list[Event]]:
    asked = DeliveryQuestion(**({"sample": SAMPLE, "backend": "oracle", "settings": SMALL} | question))
    run = Run(Order(asked), runs)
    return await run.fly(services.simulated()), read_events(run.record.folder)


async def test_a_sample_is_delivered_from_its_sentence_to_its_window(services: Services, runs: Path) -> None:
    result, events = await fly(services, runs)
    assert result.outcome == "delivered", result.message
    assert (result.floor, result.object) == (4, "green flower pot")
    assert result.verdict is not None
    assert result.verdict.distance_m is not None
    assert result.verdict.distance_m <= 3.0
    assert not result.verdict.collided
    assert {e.phase for e in events} == {"parse", "place", "floors", "explore", "approach", "claim", "done"}
    assert all(c.unreadable == c.refused == c.unreachable == 0 for c in result.model_calls.values())


async def test_the_episode_is_given_back_at_the_end(services: Services, runs: Path, at: Addresses) -> None:
    short = SMALL.model_copy(update={"max_exploration_steps": 1})
    _, events = await fly(services, runs, settings=short)
    placed = next(e for e in events if e.kind == "placed")
    async with httpx.AsyncClient(base_url=at.sim) as client:
        assert (await client.get(f"/v1/episodes/{placed.data.vehicle}")).status_code == 404


@pytest.mark.parametrize("request_text", ["Please bring me my parcel.", "fourth floor please", "the green flower pot"])
async def test_a_request_without_floor_or_object_is_incomplete(
    services: Services, runs: Path, request_text: str
) -> None:
    result, _ = await fly(services, runs, request=request_text)
    assert result.outcome == "request_incomplete"
    assert result.steps == 0


async def test_an_unknown_class_of_object_is_named_by_the_simulator(services: Services, runs: Path) -> None:
    sample = sample_library.load(SAMPLE)
    unicorn = SceneObject(id="u", kind="unicorn", colour="white", place=FreePlace(position=Point3(x=0, y=-30, z=0)))
    scene = sample.scene.model_copy(update={"objects": (*sample.scene.objects, unicorn)})
    result, _ = await fly(services, runs, sample=None, scene=scene, request=sample.request)
    assert result.outcome == "failed"
    assert "unicorn" in result.message


@pytest.mark.parametrize("down", FLIGHT_SERVICES)
async def test_a_service_that_is_down_ends_the_delivery_by_name(at: Addresses, runs: Path, down: str) -> None:
    nowhere = f"http://127.0.0.1:{free_ports([down])[down]}"
    async with Services(dataclasses.replace(at, **{down: nowhere})) as services:
        settings = SMALL.model_copy(update={"max_exploration_steps": 2})
        result, events = await fly(services, runs, settings=settings, request="floor 4, the white unicorn")
    assert result.outcome == "service_unreachable"
    assert down in result.message
    assert events[-1].kind == "result"


async def test_a_model_that_is_not_there_is_told_from_a_service(services: Services, runs: Path) -> None:
    result, _ = await fly(services, runs, backend="no-such-model")
    assert result.outcome == "model_unreachable"
    assert "no-such-model" in result.message


async def test_over_rest_a_model_that_is_not_there_is_refused_with_those_that_are(orchestrator_url: str) -> None:
    async with httpx.AsyncClient(base_url=orchestrator_url, timeout=60) as client:
        before = (await client.get("/v1/deliveries")).json()
        refused = await client.post("/v1/deliveries", json={"sample": SAMPLE, "backend": "no-such-model"})
        assert refused.status_code == 422
        assert refused.json()["error"]["code"] == "unknown_model"
        assert "there are embedded, oracle" in refused.json()["error"]["message"]
        assert (await client.get("/v1/deliveries")).json() == before


async def test_a_thing_never_learnt_is_told_on_the_ground(services: Services, runs: Path) -> None:
    result, _ = await fly(services, runs, backend="embedded", request="4th floor, the window with the saxophone")
    assert (result.outcome, result.path_m, result.steps) == ("object_unknown", 0.0, 0)
    assert "never learnt to recognise a saxophone" in result.message


async def test_cancelling_in_the_air_ends_the_flight_and_the_episode(
    services: Services, runs: Path, at: Addresses
) -> None:
    counting = asyncio.Event()

    def listen(event: Event) -> None:
        if event.kind == "floor_count":
            counting.set()

    run = Run(Order(DeliveryQuestion(sample=SAMPLE, backend="oracle", settings=SMALL)), runs, listener=listen)
    task = asyncio.create_task(run.fly(services.simulated()))
    await asyncio.wait_for(counting.wait(), 60)
    task.cancel()
    result = await task
    assert result.outcome == "cancelled"
    assert (run.record.folder / "result.json").is_file()
    assert read_events(run.record.folder)[-1].kind == "result"
    placed = next(e for e in read_events(run.record.folder) if e.kind == "placed")
    async with httpx.AsyncClient(base_url=at.sim) as client:
        assert (await client.get(f"/v1/episodes/{placed.data.vehicle}")).status_code == 404


def test_over_rest_the_events_stream_and_can_be_replayed(orchestrator_url: str) -> None:
    body = {"sample": SAMPLE, "backend": "oracle", "settings": json.loads(SMALL.model_dump_json())}
    with httpx.Client(base_url=orchestrator_url, timeout=60) as client:
        assert client.get("/readyz").status_code == 200
        name = client.post("/v1/deliveries", json=body).json()["id"]

        def numbers(after: int) -> list[int]:
            headers = {"Last-Event-ID": str(after)}
            with client.stream("GET", f"/v1/deliveries/{name}/events", headers=headers) as answer:
                return [int(line[4:]) for line in answer.iter_lines() if line.startswith("id: ")]

        live = numbers(0)
        assert live == list(range(1, len(live) + 1))
        assert numbers(5) == live[5:]
        done = client.get(f"/v1/deliveries/{name}").json()
        assert done["result"]["outcome"] == "delivered"
        assert client.get(f"/v1/deliveries/{name}/files/summary.png").content[:4] == b"\x89PNG"


def deliver(*arguments: str, at: Addresses, runs: Path) -> subprocess.Popen[str]:
    urls = ",".join(f"{name}={url}" for name, url in vars(at).items())
    command = [sys.executable, "-m", "command_line", "deliver", *arguments, "--services", urls, "--out", str(runs)]
    command = [*WITH_THE_TESTS, *command]
    pipe = subprocess.PIPE
    return subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True, env=dict(os.environ))


def test_the_command_line_prints_one_json_object_and_ends_with_zero_when_delivered(at: Addresses, runs: Path) -> None:
    process = deliver("--sample", SAMPLE, "--backend", "oracle", "--image-size", "320", "--json", at=at, runs=runs)
    out, _ = process.communicate(timeout=120)
    told = json.loads(out)
    assert process.returncode == 0
    assert told["outcome"] == "delivered"
    assert {"message", "steps", "path_m", "floor", "object", "timings_s", "model_calls", "folder"} <= told.keys()
    assert (Path(told["folder"]) / "summary.png").is_file()


def test_an_interrupt_on_the_command_line_leaves_a_complete_record(at: Addresses, runs: Path) -> None:
    process = deliver("--sample", SAMPLE, "--backend", "oracle", "--json", at=at, runs=runs)
    give_up = time.monotonic() + 60
    while not list(runs.glob("*/pictures/*")) and time.monotonic() < give_up:
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    out, _ = process.communicate(timeout=60)
    assert process.returncode == 130
    assert json.loads(out)["outcome"] == "cancelled"
    assert list(runs.glob("*/result.json"))


@pytest.mark.slow
@pytest.mark.parametrize("sample", sample_library.names())
async def test_every_sample_is_delivered_with_true_answers_and_without_a_collision(
    services: Services, runs: Path, sample: str
) -> None:
    result, _ = await fly(services, runs, sample=sample, settings=MissionSettings())
    assert result.outcome == "delivered", result.message


async def test_a_request_of_ones_own_on_a_sample_is_flown_and_told_as_what_it_is(
    services: Services, runs: Path
) -> None:
    result, events = await fly(
        services, runs, backend="embedded", request="fourth floor, the window with the red flower pot"
    )
    assert result.outcome == "stopped_not_judged", result.message
    assert "a window with a red flower pot on floor 4, as asked" in result.message
    assert "the goal of the scene itself is another" in result.message
    assert result.verdict is not None
    assert (result.verdict.judged, result.verdict.delivered) == (False, False)
    assert not any("delivered" in event.message for event in events)


async def test_other_words_for_a_samples_own_window_are_judged_by_its_goal(services: Services, runs: Path) -> None:
    result, _ = await fly(services, runs, request="fourth floor, the window with the green flower pot")
    assert result.outcome == "delivered", result.message
