"""What a person sees in the terminal, live or as plain lines."""

import io
from pathlib import Path

from rich.console import Console

from command_line.delivery_view import LiveView, PlainView, print_result
from contracts.events import Event, ResultEvent
from contracts.orchestrator import DeliveryQuestion
from mission.clients import Simulated
from mission.record import read_delivery
from orchestrator.delivery import Order, Run
from tests.mission.block import Block, block_scene
from tests.mission.block_vehicle import BlockWorld
from tests.mission.box_world import block_ports

REQUEST = "floor 4, [bold] the green flower pot"


async def flown(tmp_path: Path) -> tuple[list[Event], Run]:
    world = BlockWorld(Block(thing=(2.0, 6.2, 10.5), thing_normal=(0.0, 1.0)))
    events: list[Event] = []
    question = DeliveryQuestion(request=REQUEST, scene=block_scene(world.block))
    run = Run(Order(question), tmp_path, listener=events.append)
    await run.fly(Simulated(block_ports(world), world))
    return events, run


async def test_without_a_terminal_every_event_is_one_plain_line(tmp_path: Path) -> None:
    events, _ = await flown(tmp_path)
    out = io.StringIO()
    with PlainView(Console(file=out, width=60)) as view:
        for event in events:
            view.show(event)
    lines = out.getvalue().splitlines()
    assert len(lines) == len(events)
    assert all(e.message in line for e, line in zip(events, lines, strict=True))
    assert "\x1b" not in out.getvalue()


async def test_the_live_view_shows_phases_model_calls_and_the_request_as_it_was_written(tmp_path: Path) -> None:
    events, run = await flown(tmp_path)
    console = Console(file=io.StringIO(), width=110, height=50, force_terminal=True, record=True)
    with LiveView(console, REQUEST, "embedded") as view:
        for event in events:
            view.show(event)
    shown = console.export_text(clear=False)
    assert REQUEST in shown
    assert "✔ floors" in shown
    assert "model: recognition" in shown
    assert "delivered" in shown
    result = events[-1]
    assert isinstance(result, ResultEvent)
    plain = Console(file=io.StringIO(), width=110, record=True)
    told = run.record.folder
    print_result(plain, result.data, str(told))
    text = plain.export_text()
    assert text.startswith("DELIVERED")
    assert str(told) in text


async def test_the_end_says_which_model_answered_in_each_role(tmp_path: Path) -> None:
    _, run = await flown(tmp_path)
    result = read_delivery(run.record.folder).result
    assert result is not None
    looks = result.model_calls["recognition"]
    assert looks.models == ("geometry",)
    two = looks.model_copy(update={"calls": 6, "cache_hits": 2, "models": ("mine", "embedded-4")})
    console = Console(record=True, width=120, file=io.StringIO())
    print_result(console, result.model_copy(update={"model_calls": {"recognition": two}}), "runs/x")
    assert "recognition 6 by mine and embedded-4 (2 cached)" in console.export_text()


async def test_what_nobody_judged_is_not_shown_as_delivered(tmp_path: Path) -> None:
    _, run = await flown(tmp_path)
    result = read_delivery(run.record.folder).result
    assert result is not None
    console = Console(record=True, width=100, file=io.StringIO())
    print_result(console, result.model_copy(update={"outcome": "stopped_not_judged"}), "runs/x")
    assert console.export_text().startswith("STOPPED NOT JUDGED")
