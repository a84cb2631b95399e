"""A real browser, Debian's Chromium driven by Playwright, and orchestrators to look at."""

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import httpx
import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, BrowserContext, Page, expect, sync_playwright

from tests.mission.block_vehicle import BlockWorld
from tests.orchestrator.door import Door
from tests.orchestrator.orders import BEHIND, finished, order

DESK = {"width": 1360, "height": 900}
PHONE = {"width": 390, "height": 844}
PATIENCE_MS = 45_000
"""A machine may have much else to do."""
OpenPage = Callable[..., Page]
expect.set_options(timeout=PATIENCE_MS)


@pytest.fixture(scope="module")
def chromium() -> Iterator[Browser]:
    """Closed with its module: while Playwright runs, this thread has an event loop, and asynchronous tests can't."""
    program = shutil.which("chromium")
    if program is None:
        raise RuntimeError("chromium is not installed; `make test` installs Debian's package chromium")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=["--no-sandbox", "--disable-gpu"])
        yield browser
        browser.close()


@pytest.fixture
def open_page(chromium: Browser) -> Iterator[OpenPage]:
    """`open_page(url, **context)` opens a page of a browser of its own. A script's error on it, or something that the
    content security policy refuses, fails the test."""
    contexts: list[BrowserContext] = []
    wrong: list[str] = []

    def make(url: str, **options: object) -> Page:
        usual = {"viewport": DESK, "locale": "en-GB", "timezone_id": "Europe/Berlin"}
        contexts.append(chromium.new_context(**(usual | options)))
        contexts[-1].set_default_timeout(PATIENCE_MS)
        page = contexts[-1].new_page()
        page.on("pageerror", lambda error: wrong.append(f"{error.message} {error.stack}"))
        page.on("console", lambda m: wrong.append(m.text) if "Content Security Policy" in m.text else None)
        page.goto(url)
        return page

    yield make
    for context in contexts:
        context.close()
    assert not wrong, wrong


class House:
    """An orchestrator before the block world, which can be taken away and opened again at the same address. One at a
    time in a process: a module of tests has its own."""

    def __init__(self, runs: Path, **options: object) -> None:
        self.runs = runs
        self.world = BlockWorld(BEHIND)
        self._options = options
        self.door = Door(runs, self.world, **options)
        self.port = self.door.client.base_url.port

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    @property
    def client(self) -> httpx.Client:
        return self.door.client

    def order(self, **more: object) -> str:
        return str(self.client.post("/v1/deliveries", json=order(self.world, **more)).json()["id"])

    def delivered(self, **more: object) -> str:
        name = self.order(**more)
        finished(self.client, name)
        return name

    def leave(self) -> None:
        self.door.close()

    def come_back(self) -> None:
        self.door = Door(self.runs, self.world, port=self.port, **self._options)


@pytest.fixture(scope="module")
def house(tmp_path_factory: pytest.TempPathFactory) -> Iterator[House]:
    """Everybody is an operator."""
    house = House(tmp_path_factory.mktemp("runs"))
    yield house
    house.leave()


def serious(page: Page) -> list[str]:
    """What axe finds on a page that keeps somebody out: its rule, and where."""
    found = Axe().run(page).response["violations"]
    grave = [one for one in found if one["impact"] in ("serious", "critical")]
    return [f"{one['id']}: {node['html'][:120]}" for one in grave for node in one["nodes"]]
