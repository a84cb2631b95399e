"""What people do on the pages, in a real browser: the essential part."""

import re

import pytest
from playwright.sync_api import expect

from tests.orchestrator.viewer.conftest import House, OpenPage, serious


def test_a_delivery_is_ordered_its_question_answered_and_its_end_understood(house: House, open_page: OpenPage) -> None:
    page = open_page(house.url)
    page.get_by_role("link", name="Order").click()
    page.get_by_label("What shall be brought where?").fill("Bring it to floor 4")
    understood = page.locator(".understood")
    expect(understood).to_contain_text("Floor4")
    expect(understood).to_contain_text("What can be seen at your window from outside?")
    understood.get_by_label("Your answer").fill("the green flower pot")
    understood.get_by_role("button", name="Answer").click()
    expect(understood).to_contain_text("Nothing is open")
    page.get_by_role("button", name="Order the delivery").click()
    expect(page.get_by_role("heading", level=1)).to_contain_text("Bring it to floor 4")
    expect(page.locator(".actions .badge")).to_have_text(re.compile("delivered|wrong window"))
    expect(page.get_by_role("button", name="Cancel delivery")).to_be_hidden()
    answered = house.client.get("/v1/overview").json()["deliveries"][0]
    assert (answered["request"], answered["status"]) == ("Bring it to floor 4", "done")


def test_a_question_of_a_delivery_is_answered_on_its_page(house: House, open_page: OpenPage) -> None:
    name = house.order(request="floor 4")
    page = open_page(f"{house.url}/#/delivery/{name}")
    asked = page.locator(".ask")
    expect(asked).to_contain_text("What can be seen at your window")
    expect(asked).to_contain_text("waited for until")
    asked.get_by_label("Your answer").fill("the green flower pot")
    asked.get_by_role("button", name="Answer").click()
    expect(asked).to_be_hidden()
    expect(page.locator(".actions .badge")).to_have_text("delivered")


def test_a_moment_of_a_delivery_has_an_address_and_its_plan_a_legend(house: House, open_page: OpenPage) -> None:
    name = house.delivered()
    page = open_page(f"{house.url}/#/delivery/{name}/0.0")
    expect(page.locator(".actions .badge")).not_to_have_text("delivered")
    page.keyboard.press("End")
    expect(page.locator(".actions .badge")).to_have_text("delivered")
    legend = page.get_by_role("list", name="Legend of the plan")
    for said in ("way flown", "facade looked at", "thing seen", "building delivered to"):
        expect(legend.get_by_text(said)).to_be_visible()
    page.keyboard.press("ArrowLeft")
    expect(page.locator(".actions .badge")).not_to_have_text("delivered")
    expect(page.locator(".views img").first).to_be_visible()
    assert serious(page) == []


def test_a_server_that_is_gone_is_said_and_nothing_can_be_ordered_until_it_is_back(
    house: House, open_page: OpenPage
) -> None:
    page = open_page(f"{house.url}/#/order")
    send = page.get_by_role("button", name="Order the delivery")
    expect(send).to_be_enabled()
    page.goto(house.url + "/#/")
    expect(page.get_by_role("heading", name="Vehicles")).to_be_visible()
    house.leave()
    try:
        expect(page.locator("#connection")).to_contain_text("interrupted")
        expect(page.locator(".trouble")).to_contain_text("What is shown is as it was at")
        expect(page.locator("#connection")).to_contain_text("The server is gone")
        page.get_by_role("link", name="Order").click()
        expect(page.get_by_role("button", name="Order the delivery")).to_be_disabled()
    finally:
        house.come_back()
    page.get_by_role("link", name="Fleet").click()
    expect(page.locator("#connection")).to_be_hidden(timeout=15_000)


@pytest.mark.parametrize(("path", "there"), [("#/", "Vehicles"), ("#/order", "Understood")])
def test_axe_finds_nothing_serious(house: House, open_page: OpenPage, path: str, there: str) -> None:
    page = open_page(f"{house.url}/{path}")
    expect(page.get_by_role("heading", name=there)).to_be_visible()
    assert serious(page) == []
