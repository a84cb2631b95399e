"""Logging in, looking on, and the customer's page, in a real browser."""

import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect

from orchestrator.access import Access
from tests.orchestrator.orders import REQUEST
from tests.orchestrator.viewer.conftest import PHONE, House, OpenPage, serious

OPERATOR, READER = "operators-token", "readers-token"


@pytest.fixture(scope="module")
def secured(tmp_path_factory: pytest.TempPathFactory) -> Iterator[House]:
    """Asks for tokens."""
    access = Access(OPERATOR, READER, lambda: "key of the test", 3600)
    house = House(tmp_path_factory.mktemp("runs"), access=access, service_within_s=600.0)
    house.client.headers["authorization"] = f"Bearer {OPERATOR}"
    yield house
    house.leave()


def logged_in(page: Page, token: str) -> None:
    page.get_by_label("Token of this orchestrator").fill(token)
    page.get_by_role("button", name="Log in").click()


def test_who_logs_in_sees_what_their_token_is_for(secured: House, open_page: OpenPage) -> None:
    name = secured.delivered()
    page = open_page(f"{secured.url}/#/delivery/{name}")
    expect(page).to_have_url(re.compile("/login"))
    logged_in(page, "guessed")
    expect(page.get_by_role("alert")).to_have_text("This token is not known here.")
    logged_in(page, READER)
    expect(page.get_by_role("heading", level=1)).to_contain_text(REQUEST)
    expect(page.get_by_role("link", name="Order")).to_be_hidden()
    expect(page.get_by_role("button", name="Customer's link")).to_have_count(0)
    page.get_by_role("button", name="Log out").click()
    expect(page).to_have_url(re.compile("/login"))
    assert serious(page) == []
    logged_in(page, OPERATOR)
    expect(page.get_by_role("link", name="Order")).to_be_visible()


def test_a_customers_link_shows_their_delivery_and_takes_their_answer(secured: House, open_page: OpenPage) -> None:
    name = secured.order(request="floor 4")
    link = secured.client.post(f"/v1/deliveries/{name}/link").json()["path"]
    page = open_page(secured.url + link, viewport=PHONE)
    expect(page.get_by_role("heading", level=1)).to_have_text("Your delivery")
    expect(page.locator(".asked")).to_have_text("What can be seen at your window from outside?")
    assert serious(page) == []
    page.get_by_label("Your answer").fill("the green flower pot")
    page.get_by_role("button", name="Answer").click()
    expect(page.locator("#now")).to_contain_text("The drone is in front of your window")
    expect(page.locator("#stop img")).to_be_visible()
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.wait_for_timeout(2500)
    assert asked == [], "a delivery that is over is not asked after"
    assert page.evaluate("document.documentElement.scrollWidth") <= PHONE["width"]
    page.goto(f"{secured.url}{link}x")
    expect(page.get_by_role("heading", level=1)).to_have_text("This link opens no delivery")


def test_a_customer_is_told_that_their_drone_is_silent_and_where_it_was(secured: House, open_page: OpenPage) -> None:
    secured.world.pace = 1.0
    name = secured.order()
    link = secured.client.post(f"/v1/deliveries/{name}/link").json()["path"]
    page = open_page(secured.url + link, viewport=PHONE)
    expect(page.locator(".where")).to_contain_text("m above the ground")
    expect(page.locator("#outlook")).to_contain_text(re.compile("In the air for .*(usually takes|not known yet)"))
    secured.world.silent = True
    try:
        expect(page.locator("#trouble")).to_contain_text("last heard")
        expect(page.locator(".where")).to_contain_text("when it was last heard")
        page.reload()
        expect(page.locator("#trouble")).to_have_text("The drone does not tell just now where it is.")
        expect(page.locator("#map .building, #map .target").first).to_be_visible()
    finally:
        secured.world.silent, secured.world.pace = False, 0.0
    secured.client.delete(f"/v1/deliveries/{name}")
    expect(page.locator("#now")).to_contain_text(re.compile("cancelled|window"))
    expect(page.locator("#trouble")).to_be_hidden()
