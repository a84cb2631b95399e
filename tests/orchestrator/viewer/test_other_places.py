"""Where the pages look on without a simulator's street: a vehicle where it stands, and a run of the benchmark."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import expect

from contracts.event_data import BandDecision, FloorCountData, LookData, PlacedData
from contracts.geometry import Pose
from contracts.vlm_gateway import FindObjectAnswer, FloorCountAnswer, Tokens
from orchestrator.replay_app import build_replay_app
from orchestrator.replays import Replays
from tests.conftest import Serve
from tests.mission.block_vehicle import BlockVehicle
from tests.mission.box_world import RIG
from tests.orchestrator.door import OneDrone
from tests.orchestrator.orders import BEHIND, REQUEST
from tests.orchestrator.test_replays import end, record
from tests.orchestrator.viewer.conftest import House, OpenPage, serious

pytestmark = pytest.mark.browser
START = Pose(x=0.0, y=0.0, z=2.0, yaw=0.0)
CHAT = {"outcome": "answered", "backend": "chat", "model": "a-model", "tokens": Tokens(prompt=900, completion=100)}


@pytest.fixture
def own_drone(tmp_path: Path) -> Iterator[House]:
    """An orchestrator with one vehicle, which stands ready in the block world, and no simulator."""
    house = House(tmp_path, hangar=OneDrone(BlockVehicle(BEHIND, "e1", RIG, pace=2.0)))
    yield house
    house.leave()


def test_a_vehicle_without_a_scene_is_ordered_watched_and_called_back(own_drone: House, open_page: OpenPage) -> None:
    page = open_page(f"{own_drone.url}/#/order")
    expect(page.get_by_label("Street")).to_have_text("where the vehicle stands")
    page.get_by_label("What shall be brought where?").fill(REQUEST)
    expect(page.locator(".understood")).to_contain_text("Nothing is open")
    page.get_by_role("button", name="Order the delivery").click()
    expect(page.locator(".where")).to_contain_text("m high")
    name = page.url.rpartition("/")[2]
    page.goto(own_drone.url)
    expect(page.locator(f'[data-delivery="{name}"]')).to_have_attribute("transform", re.compile("translate"))
    expect(page.get_by_role("heading", name="where the vehicle stands")).to_be_visible()
    page.goto(f"{own_drone.url}/#/delivery/{name}")
    legend = page.get_by_role("list", name="Legend of the plan")
    expect(legend.get_by_text("wall, as depth saw it")).to_be_visible()
    expect(legend.get_by_text("building delivered to")).to_be_hidden()
    page.on("dialog", lambda dialog: dialog.accept())
    page.get_by_role("button", name="Cancel delivery").click()
    expect(page.locator(".actions .badge")).to_have_text("cancelled")
    assert serious(page) == []


def test_a_run_of_the_benchmark_is_watched_live(tmp_path: Path, serve: Serve, open_page: OpenPage) -> None:
    flown = record(tmp_path, "006")
    page = open_page(serve(build_replay_app(Replays(tmp_path))))
    expect(page.locator(".flights")).to_contain_text("takes off")
    flown.write(1, "place", "at the start", PlacedData(vehicle="e1", pose=START))
    expect(page.locator(".flights")).to_contain_text("1 floor 4")
    expect(page.locator(".flights")).to_contain_text("2.0 m high at its last stop")
    expect(page.locator('[data-delivery="006"]')).to_have_attribute("transform", re.compile("translate"))
    end(flown)
    expect(page.locator(".list .badge")).to_have_text("failed")
    expect(page.locator(".street")).to_have_count(0)
    assert serious(page) == []


def counted(answer: FloorCountAnswer) -> FloorCountData:
    return FloorCountData(
        pose=START,
        band=None,
        facade_top_m=None,
        floors_new=3,
        floors_wanted=4,
        answer=answer,
        decision="Climb",
        detail=BandDecision(band=None, floors_counted=3.0),
        seconds=1.5,
    )


def test_what_models_cost_is_told_where_there_is_a_price_and_what_was_not_kept_is_said(
    tmp_path: Path, serve: Serve, open_page: OpenPage
) -> None:
    flown = record(tmp_path, "006")
    flown.write(1, "floors", "three floors", counted(FloorCountAnswer(role="floors", floors=3, **CHAT)))
    found = FindObjectAnswer(role="recognition", found=False, **CHAT)
    look = LookData(exploration_step=1, pose=START, object="cake", answer=found, render_s=0.0, seconds=1.0)
    flown.write(2, "explore", "no cake", look)
    page = open_page(serve(build_replay_app(Replays(tmp_path))) + "/#/delivery/006")
    calls = page.get_by_role("region", name="Questions to models")
    expect(calls.get_by_role("row")).to_have_count(3)
    expect(calls.get_by_role("columnheader", name="Cost")).to_be_hidden()
    expect(page.locator(".views .missing").first).to_have_text("No picture was kept.")
    page.get_by_role("button", name="Depth").click()
    expect(page.locator(".views .missing").first).to_have_text("No depth was recorded.")
    expect(page.locator(".depth-scale")).to_be_hidden()
    flown.write(3, "floors", "three floors", counted(FloorCountAnswer(role="floors", floors=3, usd=0.0123, **CHAT)))
    expect(calls.get_by_role("columnheader", name="Cost")).to_be_visible()
    expect(calls.get_by_role("row").last).to_contain_text("$ 0.01230")
    expect(page.get_by_role("heading", name="Questions to models")).to_contain_text("$ 0.01230 for 1 of 3 with a price")
    end(flown)
