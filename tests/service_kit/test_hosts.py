"""By which names a service may be called, and who may call one that asks for no token."""

import os
import subprocess
import sys
import threading
from collections.abc import Iterator

import httpx
import pytest
import uvicorn

from service_kit.app import create_app
from service_kit.hosts import Hosts, is_loopback
from service_kit.run import server_config
from tests.conftest import free_port


@pytest.mark.parametrize(
    ("host", "allowed"),
    [
        ("127.0.0.1:8100", True),
        ("localhost", True),
        ("LocalHost.:8100", True),
        ("[::1]:8100", True),
        ("192.168.1.7:8100", True),
        ("drones.example:443", True),
        ("a.fleet.internal", True),
        ("sim:8104", True),
        ("vlm-gateway", True),
        ("fleet.internal", False),
        ("evilfleet.internal", False),
        ("evil.example:8100", False),
        ("drones.example.evil.example", False),
        ("127.0.0.1.evil.example", False),
        ("evil example", False),
        ("-", False),
        ("", False),
    ],
)
def test_names_are_those_of_the_list_and_addresses_and_single_labels_are_always_right(host: str, allowed: bool) -> None:
    assert Hosts(["drones.example", "*.fleet.internal", ""]).allow(host) is allowed
    assert Hosts(["*"]).allow(host)


def test_only_the_loopback_is_this_machine_alone() -> None:
    assert [is_loopback(host) for host in ("127.0.0.1", "localhost", "::1")] == [True] * 3
    assert [is_loopback(host) for host in ("0.0.0.0", "::", "192.168.1.7", "drones.example")] == [False] * 4


@pytest.fixture(scope="module")
def url() -> Iterator[str]:
    port = free_port()
    app = create_app("named", max_body_bytes=100)
    app.post("/echo")(lambda: "served")
    server = uvicorn.Server(server_config(app, "127.0.0.1", port, 2, hosts=Hosts(["named.example"])))
    thread = threading.Thread(target=server.run, daemon=True)
    thread.start()
    while not server.started:
        thread.join(0.02)
    yield f"http://127.0.0.1:{port}"
    server.should_exit = True
    thread.join()


@pytest.mark.parametrize("more", [{}, {"content": b"x" * 50}, {"content": iter([b"x", b"y"])}])
def test_another_name_is_refused_whatever_is_sent(url: str, more: dict[str, object]) -> None:
    answer = httpx.post(f"{url}/echo", headers={"Host": "evil.example"}, **more)  # type: ignore[arg-type]
    assert (answer.status_code, answer.json()["error"]["code"]) == (421, "misdirected")
    assert "ALLOWED_HOSTS" in answer.json()["error"]["message"]


def test_its_own_names_are_served_and_health_has_any(url: str) -> None:
    for host in ("named.example", "named.example:8100", "localhost"):
        assert httpx.post(f"{url}/echo", headers={"Host": host}).json() == "served"
    assert httpx.get(f"{url}/healthz", headers={"Host": "evil.example"}).status_code == 200
    assert httpx.get(f"{url}/metrics", headers={"Host": "evil.example"}).status_code == 421


def test_a_connection_that_came_by_the_right_name_is_not_let_through_by_another(url: str) -> None:
    for other in ("evil.example", ""):
        with httpx.Client(base_url=url) as client:  # a refusal ends the connection
            told = [client.post("/echo", headers={"host": host}).status_code for host in ("named.example", other)]
        assert told == [200, 421]
    assert httpx.post(f"{url}/echo", headers={"host": ""}).status_code == 421


@pytest.mark.parametrize(
    ("service", "variable"), [("depth_assist", "DEPTH_ASSIST_TOKEN"), ("vlm_gateway", "GATEWAY_TOKEN")]
)
def test_a_service_that_asks_for_no_token_does_not_listen_to_strangers_unless_it_is_told(
    service: str, variable: str
) -> None:
    environment = os.environ | {"HOST": "0.0.0.0", "PORT": str(free_port()), "CACHE_MODE": "off"}
    command = [sys.executable, "-m", f"services.{service}"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 1
    assert f"{service} can't start: HOST=0.0.0.0 listens beyond this machine" in done.stderr
    assert f"set {variable} or {variable}_FILE" in done.stderr
    for more, warned in (({"LISTEN_WITHOUT_TOKEN": "on"}, True), ({variable: "s3cret"}, False)):
        with subprocess.Popen(command, env=environment | more, stderr=subprocess.PIPE, text=True) as started:
            try:
                until_served(int(environment["PORT"]))
            finally:
                started.kill()
            assert started.stderr is not None
            assert ("LISTEN_WITHOUT_TOKEN is on" in started.stderr.read()) is warned


def until_served(port: int) -> None:
    with httpx.Client(transport=httpx.HTTPTransport(retries=0)) as client:
        for _ in range(600):
            try:
                if client.get(f"http://127.0.0.1:{port}/healthz").status_code == 200:
                    return
            except httpx.ConnectError:
                threading.Event().wait(0.1)
    raise AssertionError("not served within a minute")
