"""Who may do what: operators, those who look on, and customers with a link; by token and in a browser."""

import asyncio
import stat
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from orchestrator.access import EVERYBODY, Access, signing_key
from orchestrator.access_routes import add_access_routes
from service_kit.app import create_app
from service_kit.settings import BadSetting
from tests.mission.block_vehicle import BlockWorld
from tests.orchestrator.door import Door
from tests.orchestrator.orders import BEHIND, finished, order

OPERATOR, READER = "operators-token", "readers-token"
OWN = {"Sec-Fetch-Site": "same-origin"}


def bearer(token: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {token}"}


@pytest.fixture(scope="module")
def url(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    runs = tmp_path_factory.mktemp("runs")
    door = Door(runs, BlockWorld(BEHIND), access=Access(OPERATOR, READER, lambda: signing_key(None, runs), 3600))
    yield str(door.client.base_url)
    door.close()


@pytest.fixture
def browser(url: str) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=url, timeout=20) as client:
        yield client


@pytest.fixture(scope="module")
def delivery(url: str) -> str:
    """One that is over."""
    with httpx.Client(base_url=url, timeout=20, headers=bearer(OPERATOR)) as client:
        name = str(client.post("/v1/deliveries", json=order(BlockWorld(BEHIND))).json()["id"])
        finished(client, name)
        return name


def code(answer: httpx.Response) -> tuple[int, str]:
    return answer.status_code, answer.json()["error"]["code"]


def test_whoever_opens_the_viewer_logs_in_first_and_the_cookie_is_out_of_scripts_reach(browser: httpx.Client) -> None:
    assert (browser.get("/").status_code, browser.get("/").headers["location"]) == (303, "/login")
    assert "password" in browser.get("/login").text
    assert code(browser.post("/v1/session", json={"token": "guessed"})) == (401, "unauthorised")
    answer = browser.post("/v1/session", json={"token": OPERATOR})
    assert answer.json() == {"role": "operator", "asked": True}
    cookie = answer.headers["set-cookie"].lower()
    assert "httponly" in cookie
    assert "samesite=strict" in cookie
    assert OPERATOR not in cookie
    assert browser.get("/").status_code == 200
    assert browser.get("/v1/deliveries").status_code == 200
    browser.delete("/v1/session", headers=OWN)
    assert browser.get("/v1/deliveries").status_code == 401


def test_a_cookie_is_secure_where_a_proxy_ends_tls(browser: httpx.Client) -> None:
    behind = browser.post("/v1/session", json={"token": OPERATOR}, headers={"X-Forwarded-Proto": "https"})
    assert "secure" in behind.headers["set-cookie"].lower()


@pytest.mark.parametrize(
    ("headers", "taken"),
    [
        ({"Origin": "http://evil.example", "Sec-Fetch-Site": "cross-site"}, False),
        ({"Origin": "null"}, False),
        ({}, False),
        ({"Sec-Fetch-Site": "same-site"}, False),
        (OWN, True),
        ({"Origin": "own"}, True),
    ],
)
def test_with_a_cookie_changes_come_from_our_own_pages_only(
    browser: httpx.Client, delivery: str, headers: dict[str, str], taken: bool
) -> None:
    browser.post("/v1/session", json={"token": OPERATOR})
    sent = {k: str(browser.base_url).rstrip("/") if v == "own" else v for k, v in headers.items()}
    answer = browser.post(f"/v1/deliveries/{delivery}/link", headers=sent)
    assert answer.status_code == 200 if taken else code(answer) == (403, "foreign_page")


def test_who_looks_on_changes_nothing_by_token_or_session(browser: httpx.Client, delivery: str) -> None:
    assert browser.get(f"/v1/deliveries/{delivery}", headers=bearer(READER)).status_code == 200
    assert code(browser.delete(f"/v1/deliveries/{delivery}", headers=bearer(READER))) == (403, "read_only")
    assert browser.post("/v1/session", json={"token": READER}).json()["role"] == "read_only"
    assert browser.get("/v1/session").json()["role"] == "read_only"
    assert code(browser.post(f"/v1/deliveries/{delivery}/link", headers=OWN)) == (403, "read_only")
    assert browser.delete("/v1/session", headers=OWN).status_code == 204


def test_a_customers_link_shows_one_delivery_and_takes_its_answers_only(browser: httpx.Client, delivery: str) -> None:
    link = browser.post(f"/v1/deliveries/{delivery}/link", headers=bearer(OPERATOR)).json()["path"]
    wrong = browser.get(f"{link}x")
    assert (wrong.status_code, "opens no delivery" in wrong.text) == (404, True)
    page = browser.get(link)
    assert page.status_code == 200
    assert "httponly" in page.headers["set-cookie"].lower()
    shown = browser.get(f"/v1/deliveries/{delivery}/tracking")
    assert shown.status_code == 200
    assert not {"folder", "vehicle", "scene", "priority"} & set(shown.json())
    assert browser.get(f"/v1/deliveries/{delivery}/tracking/street").status_code == 200
    assert browser.get(f"/v1/deliveries/{delivery}/tracking/picture").headers["content-type"] == "image/jpeg"
    answer = browser.post(f"/v1/deliveries/{delivery}/answer", json={"text": "the red one"}, headers=OWN)
    assert answer.status_code == 409  # nothing is asked; but it was theirs to answer
    assert code(browser.delete(f"/v1/deliveries/{delivery}", headers=OWN)) == (403, "customer")
    assert browser.get("/v1/deliveries").status_code == 401
    cookie = {"Cookie": f"customer={browser.cookies['customer']}"}
    own = f"/v1/deliveries/{delivery}"
    for path in (
        "/v1/deliveries",
        "/v1/overview",
        "/metrics",
        f"{own}x",
        own,
        f"{own}/events",
        f"{own}/files/result.json",
    ):
        assert code(browser.get(path, headers=cookie)) == (403, "customer")


def test_a_session_ends_with_its_time_its_token_and_its_key() -> None:
    def access(token: str = OPERATOR, key: str = "key", session_s: int = 60) -> Access:
        return Access(token, None, lambda: key, session_s)

    cookie = access().session("operator")
    assert access().role_of_session(cookie) == "operator"
    for changed in (access(token="another"), access(key="another"), access(session_s=-1)):
        assert changed.role_of_session(cookie) is None
    assert access().role_of_session(cookie[:-2]) is None
    assert access().role_of_session(access().link("d")) is None
    assert access().delivery_of(cookie) is None


async def test_without_a_token_everybody_is_an_operator() -> None:
    app = create_app("orchestrator", max_body_bytes=1000)
    add_access_routes(app, EVERYBODY, known=lambda _: asyncio.sleep(0))
    async with httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://localhost") as client:
        assert (await client.get("/")).status_code == 200
        assert (await client.get("/v1/session")).json() == {"role": "operator", "asked": False}
        link = (await client.post("/v1/deliveries/d-1/link")).json()["path"]
        assert (await client.get(link)).status_code == 200
    with pytest.raises(BadSetting, match="set both"):
        Access(None, READER, lambda: "key", 60)


def test_a_key_is_drawn_once_for_all_who_share_the_folder_and_read_by_nobody_else(tmp_path: Path) -> None:
    first = signing_key(None, tmp_path / "runs")
    assert len(first) > 30
    assert signing_key(None, tmp_path / "runs") == first
    assert stat.S_IMODE((tmp_path / "runs" / ".signing-key").stat().st_mode) == 0o600
    assert [path.name for path in (tmp_path / "runs").iterdir()] == [".signing-key"]
    assert signing_key("given", tmp_path) == "given"
    (tmp_path / "file").touch()
    with pytest.raises(BadSetting, match="ORCHESTRATOR_KEY"):
        signing_key(None, tmp_path / "file")
