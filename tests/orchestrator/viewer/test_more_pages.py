"""The rest of what the pages promise, in a real browser; `make test-browser` runs it."""

import re
import shutil
import time

import pytest
from playwright.sync_api import Page, expect

from contracts.orchestrator import Delivery, DeliveryQuestion
from mission.record import Record, new_id, now
from tests.orchestrator.orders import order, until
from tests.orchestrator.viewer.conftest import DESK, PHONE, House, OpenPage, serious

pytestmark = pytest.mark.browser
MANY = 400
SMOOTH_MS = 50.0
"""The middle time between two frames while hundreds of deliveries change; a page that stutters needs hundreds of ms."""


def test_the_list_is_filtered_searched_and_continued(house: House, open_page: OpenPage) -> None:
    name = house.delivered()
    asking = house.order(request="floor 4 with words of its own")
    until(house.client, asking, "needs_answer")
    page = open_page(house.url)
    rows = page.locator(".list li")
    page.get_by_role("button", name=re.compile("asking 1")).click()
    expect(rows).to_have_count(1)
    expect(rows).to_contain_text("What can be seen at your window")
    expect(page.locator(".alerts")).to_contain_text("asks: What can be seen")
    page.get_by_role("button", name="delivered").click()
    expect(page.locator(".list")).not_to_contain_text("What can be seen at your window")
    expect(page.locator(".alerts")).to_contain_text("asks: What can be seen")
    page.get_by_role("button", name=re.compile("all")).click()
    page.get_by_role("searchbox").fill("words of its")
    expect(rows).to_have_count(1)
    page.get_by_role("searchbox").fill("no such words")
    expect(page.get_by_text("No delivery is like that.")).to_be_visible()
    page.get_by_role("searchbox").fill(name)
    rows.first.click()
    expect(page).to_have_url(re.compile(f"#/delivery/{name}"))
    house.client.delete(f"/v1/deliveries/{asking}")


def test_a_drone_in_the_air_glides_on_the_map_and_on_its_own_page(house: House, open_page: OpenPage) -> None:
    house.world.pace = 0.5
    name = house.order()
    until(house.client, name, "flying")
    page = open_page(house.url)
    drone = page.locator(f'[data-delivery="{name}"]')
    expect(drone).to_have_attribute("transform", re.compile("translate"))
    places: set[str | None] = set()
    give_up = time.monotonic() + 100
    while len(places) < 20 and time.monotonic() < give_up:  # it looks round between two flights
        page.wait_for_timeout(40)
        places.add(drone.get_attribute("transform"))
    assert len(places) == 20, "it stands, or jumps"
    page.goto(f"{house.url}/#/delivery/{name}")
    expect(page.locator(".where")).to_contain_text("live")
    expect(page.get_by_role("button", name="live", exact=True)).to_have_attribute("aria-pressed", "true")
    house.world.pace = 0.0
    house.client.delete(f"/v1/deliveries/{name}")
    expect(page.locator(".actions .badge")).to_have_text(re.compile("cancelled|delivered|wrong window"))


def test_a_drone_that_was_not_heard_is_not_shown_as_live(house: House, open_page: OpenPage) -> None:
    house.world.pace = 1.0
    name = house.order()
    page = open_page(f"{house.url}/#/delivery/{name}")
    expect(page.locator(".where")).to_contain_text("live")
    house.world.silent = True
    try:
        expect(page.locator(".trouble")).to_contain_text(re.compile(r"last heard at \d+:\d\d:\d\d"))
        expect(page.locator(".where")).not_to_contain_text("live")
    finally:
        house.world.silent, house.world.pace = False, 0.0
    house.client.delete(f"/v1/deliveries/{name}")


def test_play_runs_through_a_delivery_and_a_step_stops_it(house: House, open_page: OpenPage) -> None:
    name = house.delivered()
    page = open_page(f"{house.url}/#/delivery/{name}/0.0")
    expect(page.locator(".log tr")).not_to_have_count(0)
    page.get_by_label("Speed").select_option("0.5")
    page.get_by_role("button", name="Play").click()
    expect(page.get_by_role("button", name="Pause")).to_be_visible()
    page.keyboard.press("ArrowRight")
    expect(page.get_by_role("button", name="Play")).to_be_visible()
    page.get_by_role("button", name="Copy link").or_(page.get_by_text("copy link")).first.click()


def test_depth_is_shown_when_it_is_asked_for(house: House, open_page: OpenPage) -> None:
    name = house.delivered()
    page = open_page(f"{house.url}/#/delivery/{name}")
    seen = page.locator(".views img").first
    expect(seen).to_be_visible()
    button = page.get_by_role("button", name="Depth")
    button.click()
    expect(button).to_have_attribute("aria-pressed", "true")
    expect(seen).to_have_attribute("src", re.compile("_depth.jpg$"))
    expect(seen).to_be_visible()
    assert page.locator(".views img").count() == page.locator(".views img[src$='_depth.jpg']").count()
    expect(page.locator(".depth-scale")).to_contain_text("40 m")
    assert serious(page) == []
    button.click()
    expect(seen).not_to_have_attribute("src", re.compile("_depth.jpg$"))
    expect(page.locator(".depth-scale")).to_be_hidden()


def test_an_expired_picture_and_an_expired_delivery_are_said(house: House, open_page: OpenPage) -> None:
    name = house.delivered()
    shutil.rmtree(house.runs / name / "pictures")
    page = open_page(f"{house.url}/#/delivery/{name}")
    expect(page.locator(".views .missing").first).to_have_text("This picture is no longer kept.")
    page.goto(f"{house.url}/#/delivery/20200101-000000-abcdef")
    expect(page.locator(".trouble")).to_contain_text("no longer kept")


def test_a_delivery_that_was_cut_off_says_so(house: House, open_page: OpenPage) -> None:
    name, question = new_id(), DeliveryQuestion.model_validate(order(house.world))
    delivery = Delivery(
        id=name, status="waiting", phase="parse", request="floor 4", scene="block", created=now(), folder=None
    )
    Record(house.runs / name, delivery, question).close()
    give_up = time.monotonic() + 40
    while house.client.get(f"/v1/deliveries/{name}").status_code == 404 and time.monotonic() < give_up:
        time.sleep(0.5)
    page = open_page(f"{house.url}/#/delivery/{name}")
    expect(page.locator(".actions .badge")).to_have_text("cut off")
    expect(page.locator(".trouble")).to_contain_text("Cut off: the record breaks off")


def test_two_deliveries_are_compared(house: House, open_page: OpenPage) -> None:
    first, second = house.delivered(), house.delivered()
    page = open_page(f"{house.url}/#/compare/{first}")
    page.locator(f'a[href="#/compare/{first}/{second}"]').click()
    expect(page.get_by_role("heading", name="Two deliveries")).to_be_visible()
    expect(page.get_by_role("row", name=re.compile("state"))).to_contain_text("delivered")
    expect(page.locator(".plan .other")).to_be_visible()
    assert serious(page) == []


def test_hundreds_of_deliveries_do_not_make_it_stutter(house: House, open_page: OpenPage) -> None:
    for k in range(MANY):
        house.order(not_before="2099-01-01T00:00:00Z", request=f"floor 4, number {k}, the green flower pot")
    page = open_page(house.url)
    expect(page.locator(".list li")).to_have_count(100)
    for _ in range(3):
        page.get_by_role("button", name="Show older ones").click()
        page.wait_for_timeout(300)
    expect(page.locator(".list li")).to_have_count(400)
    middle = page.evaluate(
        """() => new Promise((done) => {
             const gaps = []; let before = performance.now();
             const tick = (now) => { gaps.push(now - before); before = now;
               gaps.length < 120 ? requestAnimationFrame(tick) : done(gaps.sort((a, b) => a - b)[60]); };
             requestAnimationFrame(tick); })"""
    )
    assert middle < SMOOTH_MS


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("size", [DESK, PHONE], ids=["desk", "phone"])
def test_every_page_is_readable_for_everybody(house: House, open_page: OpenPage, scheme: str, size: dict) -> None:
    name = house.delivered()
    page = open_page(house.url, viewport=size, color_scheme=scheme)
    for path, there in (("#/", "Vehicles"), ("#/order", "Understood"), (f"#/delivery/{name}", "Log")):
        page.goto(f"{house.url}/{path}")
        expect(page.get_by_role("heading", name=re.compile(there))).to_be_visible()
        assert serious(page) == [], path
        assert page.evaluate("document.documentElement.scrollWidth") <= size["width"], path


def test_everything_of_the_order_form_is_reached_by_keyboard(house: House, open_page: OpenPage) -> None:
    page = open_page(f"{house.url}/#/order")
    expect(page.get_by_role("heading", name="Understood")).to_be_visible()
    reached = [focused(page) for _ in range(12)]
    for wanted in ("place", "words", "Your answer", "Answer", "Order the delivery"):
        assert wanted in reached, reached


def focused(page: Page) -> str:
    """What has the focus after another press of the tab key."""
    page.keyboard.press("Tab")
    return str(
        page.evaluate(
            "document.activeElement.id || document.activeElement.ariaLabel || document.activeElement.textContent"
        )
    )


def test_a_delivery_prints_without_buttons_and_with_its_whole_log(house: House, open_page: OpenPage) -> None:
    name = house.delivered()
    page = open_page(f"{house.url}/#/delivery/{name}")
    expect(page.locator(".log tr")).not_to_have_count(0)
    page.emulate_media(media="print")
    expect(page.get_by_role("button", name="Customer's link")).to_be_hidden()
    assert page.locator(".scroll").last.evaluate("e => e.scrollHeight <= e.clientHeight + 1")


def test_what_somebody_has_begun_to_write_is_left_alone_when_the_choices_come(
    house: House, open_page: OpenPage
) -> None:
    page = open_page(house.url)
    page.route("**/v1/order-options", lambda route: (page.wait_for_timeout(800), route.continue_()))
    page.goto(f"{house.url}/#/order")
    words = page.get_by_label("What shall be brought where?")
    words.focus()
    expect(page.locator("#place option")).not_to_have_count(0)
    expect(words).to_have_value("")


WAY_AHEAD = """async () => {
  const [{ makePlan }, { Replay }] = await Promise.all([import("/pages/plan.js"), import("/pages/replay.js")]);
  const replay = new Replay(), pose = { x: 0, y: 0, z: 2, yaw: 0 };
  const drawing = { way: [[0, 0], [60, 20]], cell_m: 1, expected: [], uninspected: [], inspected: [] };
  replay.add({ number: 1, time_s: 0, phase: "place", kind: "placed", data: { pose } });
  replay.add({ number: 2, time_s: 1, phase: "explore", kind: "search", data: { drawing, stop: null } });
  const plan = makePlan();
  plan.draw({ replay, index: 1, street: null });
  return plan.node.querySelector("polyline.planned").getAttribute("points");
}"""


def test_the_way_that_is_planned_stays_in_the_plans_picture(house: House, open_page: OpenPage) -> None:
    points = open_page(house.url).evaluate(WAY_AHEAD)
    corners = [float(part) for point in points.split() for part in point.split(",")]
    assert len(corners) == 4
    assert all(0.0 <= corner <= 400.0 for corner in corners)
