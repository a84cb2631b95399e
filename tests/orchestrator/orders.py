"""Deliveries ordered at a door of the tests, and how they stand."""

import contextlib
import json
import sqlite3
import time
from collections.abc import Callable
from pathlib import Path

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
    """The delivery once it is of that status."""
    found: list[Delivery] = []

    def there() -> bool:
        found[:] = [Delivery.model_validate(client.get(f"/v1/deliveries/{name}").json())]
        assert found[0].status in (status, "waiting", "flying", "needs_answer"), f"{name} is done and was not {status}"
        return found[0].status == status

    patiently(there, f"{name} is not {status}")
    return found[0]


def aloft(client: httpx.Client, world: BlockWorld, **more: object) -> str:
    """The id of a new delivery whose drone is in the air; it stays there until the world `hovers` no more."""
    world.hovers = True
    name = str(client.post("/v1/deliveries", json=order(world, **more)).json()["id"])
    until(client, name, "flying")
    patiently(lambda: bool(world.live), "no drone was begun")
    return name


def queued(runs: Path, name: str) -> None:
    """Returns once the request has been read and the delivery stands in the queue for a vehicle."""
    patiently(lambda: _place(runs, name) == ("simulator", None), f"{name} stands in no queue for a vehicle")


def _place(runs: Path, name: str) -> tuple[str, float | None]:
    """The queue of the delivery's next turn, and when it is due; null once the engine has queued it."""
    with contextlib.closing(sqlite3.connect(runs / "deliveries.sqlite")) as database:
        lane, due = database.execute("SELECT lane, due FROM deliveries WHERE id = ?", (name,)).fetchone()
        return lane, due


def patiently(there: Callable[[], bool], missing: str) -> None:
    """Returns once it is so. A loaded machine needs time; AssertionError after two minutes."""
    give_up = time.monotonic() + 120
    while not there():
        assert time.monotonic() < give_up, missing
        time.sleep(0.02)


def finished(client: httpx.Client, name: str) -> Delivery:
    events_of(client, name)
    return Delivery.model_validate(client.get(f"/v1/deliveries/{name}").json())


def asked(client: httpx.Client, name: str) -> Delivery:
    """The delivery once it waits for an answer."""
    return until(client, name, "needs_answer")
