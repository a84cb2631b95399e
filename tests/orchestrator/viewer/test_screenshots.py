"""A first delivery as a new user has it, with all services and real pictures; and the screenshots of docs/viewer.md:
`make test-browser SCREENSHOTS=docs` writes them anew."""

import asyncio
import os
import re
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest
from playwright.sync_api import Page, expect

from launcher.processes import Processes, free_ports, oracle_settings
from service_kit.addresses import PORTS
from service_kit.settings import process_environment
from tests.orchestrator.viewer.conftest import PHONE, OpenPage

pytestmark = pytest.mark.browser
PACE = {"flight": {"pace": 0.6}}
FLIGHT_MS = 240_000
UNCLEAR = "Please bring my parcel to the window with the green flower pot."


@pytest.fixture(scope="module")
def url(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """All services, as `logisticsvln serve` starts them, the oracle switched on."""
    folder = tmp_path_factory.mktemp("house")
    ports = free_ports(PORTS)
    extra = oracle_settings(ports) | {"orchestrator": {"RUNS_DIR": str(folder / "runs"), "MAX_LIVE_DELIVERIES": "3"}}
    group = Processes(ports, folder / "logs", environment=process_environment(), extra=extra)
    try:
        group.start()
        asyncio.run(group.ready())
        yield next(child.url for child in group.children if child.name == "orchestrator")
    finally:
        group.stop()


@pytest.fixture
def shots(tmp_path: Path) -> Path:
    return Path(os.environ.get("SCREENSHOTS") or tmp_path)


def order(url: str, sample: str, **more: object) -> str:
    answer = httpx.post(f"{url}/v1/deliveries", json={"sample": sample, "backend": "oracle"} | more, timeout=30)
    assert answer.status_code == 202, answer.text
    return str(answer.json()["id"])


def ended(page: Page) -> None:
    expect(page.locator(".actions .badge")).to_have_text(re.compile("delivered|wrong|not|blocked"), timeout=FLIGHT_MS)


def test_a_first_delivery_is_ordered_and_its_end_understood_without_a_document(
    url: str, open_page: OpenPage, shots: Path
) -> None:
    page = open_page(url)
    page.get_by_role("link", name="Order").click()
    page.get_by_label("What shall be brought where?").fill(
        "Please bring my parcel to the window with the green flower pot."
    )
    understood = page.locator(".understood")
    expect(understood).to_contain_text("Which floor is the window on?")
    page.screenshot(path=shots / "viewer-order.png")
    understood.get_by_label("Your answer").fill("the fourth floor")
    understood.get_by_role("button", name="Answer").click()
    expect(understood).to_contain_text("Nothing is open")
    page.get_by_role("button", name="Order the delivery").click()
    ended(page)
    expect(page.locator(".views img").first).to_be_visible()


def test_a_fleet_and_a_delivery_look_as_the_document_shows(url: str, open_page: OpenPage, shots: Path) -> None:
    name = order(url, "green-flower-pot")
    page = open_page(f"{url}/#/delivery/{name}", viewport={"width": 1360, "height": 1160})
    ended(page)
    page.wait_for_timeout(1000)
    page.screenshot(path=shots / "viewer-delivery.png")
    flying = [order(url, sample, settings=PACE) for sample in ("tower-watering-can", "villa-teddy-bear", "street-kite")]
    order(url, "temple-vase", settings=PACE, request="the window with the blue vase")
    page = open_page(url)
    for one in flying:
        expect(page.locator(f'[data-delivery="{one}"]')).to_be_visible(timeout=FLIGHT_MS)
        expect(page.locator(f'.flights a[href="#/delivery/{one}"] + span')).to_contain_text("m high", timeout=FLIGHT_MS)
    expect(page.locator(".alerts")).to_contain_text("asks")
    page.wait_for_timeout(4000)
    page.screenshot(path=shots / "viewer-fleet.png")
    link = httpx.post(f"{url}/v1/deliveries/{flying[0]}/link", timeout=30).json()["path"]
    page = open_page(url + link, viewport=PHONE)
    expect(page.locator("#map")).to_be_visible(timeout=FLIGHT_MS)
    page.wait_for_timeout(1500)
    page.screenshot(path=shots / "viewer-customer.png")
