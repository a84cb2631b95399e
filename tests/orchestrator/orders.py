"""Deliveries ordered at a door of the tests, and how they stand."""

import json
import time

import httpx

from contracts.events import Event, read_event
from contracts.orchestrator import Delivery
from tests.mission.block import Block, block_scene
from tests.mission.block_vehicle import BlockWorld

BEHIND = Block(thing=(2.0, 6.2, 10.5), thing_normal=(0.0, 1.0))
REQUEST = "Please come to floor 4, the window with the green flower pot"
VAGUE = "Please come to the window with the green flower pot"


def order(world: BlockWorld, **more: object) -> dict[str, object]:
    scene = json.loads(block_scene(world.block).model_dump_json())
    return {"request": REQUEST, "scene": scene, "settings": {"image_size": 120}} | more


def events_of(client: httpx.Client, name: str, after: int | None = None) -> list[Event]:
    headers = {} if after is None else {"Last-Event-ID": str(after)}
    found = []
    with client.stream("GET", f"/v1/deliveries/{name}/events", headers=headers) as answer:
        assert answer.headers["content-type"].startswith("text/event-stream")
        for line in answer.iter_lines():
            if line.startswith("data: {") and line != "data: {}":
                found.append(read_event(line.removeprefix("data: ")))
    return found


def until(client: httpx.Client, name: str, status: str) -> Delivery:
    """The delivery once it is of that status, or as it stands after two minutes (a loaded machine needs time)."""
    give_up = time.monotonic() + 120
    while True:
        delivery = Delivery.model_validate(client.get(f"/v1/deliveries/{name}").json())
        if delivery.status == status or time.monotonic() > give_up:
            assert delivery.status == status
            return delivery
        time.sleep(0.02)


def read(client: httpx.Client, name: str) -> None:
    """Returns once the request has been read and the delivery stands in the queue for a vehicle."""
    with client.stream("GET", f"/v1/deliveries/{name}/events") as answer:
        next(line for line in answer.iter_lines() if '"kind":"parsed"' in line)
    time.sleep(1.0)


def finished(client: httpx.Client, name: str) -> Delivery:
    events_of(client, name)
    return Delivery.model_validate(client.get(f"/v1/deliveries/{name}").json())


def asked(client: httpx.Client, name: str) -> Delivery:
    """The delivery once it waits for an answer."""
    return until(client, name, "needs_answer")
