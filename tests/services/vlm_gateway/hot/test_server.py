"""A caller's connection, byte by byte: what a client library would never send, over real HTTP."""

import gzip
import json
import socket
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
import uvicorn

from service_kit.http_limits import ConnectionLimits
from service_kit.requests import Origins
from service_kit.run import server_config
from tests.conftest import Serve, free_port
from tests.services.vlm_gateway.kit import build, chat_backend, metric, sqlite_cache, wait_until
from tests.services.vlm_gateway.openai_mock import OpenAiMock, hangs, says, streams

PATH = "/v1/chat/completions"


def chat(words: str = "hello", **more: Any) -> bytes:
    return json.dumps({"model": "m", "messages": [{"role": "user", "content": words}], **more}).encode()


def post(body: bytes, *lines: str, target: str = PATH, version: str = "1.1") -> bytes:
    head = [f"POST {target} HTTP/{version}", "host: gateway", f"content-length: {len(body)}", *lines]
    return "\r\n".join([*head, "", ""]).encode() + body


class Caller:
    """A client that sends what it is told and reads answers one by one."""

    def __init__(self, url: str) -> None:
        host, port = url.removeprefix("http://").split(":")
        self.socket = socket.create_connection((host, int(port)), timeout=60)
        self._rest = b""

    def send(self, *parts: bytes) -> None:
        self.socket.sendall(b"".join(parts))

    def answer(self) -> tuple[int, dict[str, str], bytes]:
        """Status, headers and body of the next answer."""
        while b"\r\n\r\n" not in self._rest:
            self._rest += self._more()
        head, _, self._rest = self._rest.partition(b"\r\n\r\n")
        first, *lines = head.decode().split("\r\n")
        headers = {name.lower(): value for name, _, value in (line.partition(": ") for line in lines)}
        status = int(first.split(" ")[1])
        if status == 100:
            return status, headers, b""
        length = int(headers["content-length"])
        while len(self._rest) < length:
            self._rest += self._more()
        body, self._rest = self._rest[:length], self._rest[length:]
        return status, headers, body

    def ends(self) -> bool:
        """Whether the server closes the connection, with nothing more to say."""
        return self._rest == b"" and self.socket.recv(65536) == b""

    def _more(self) -> bytes:
        data = self.socket.recv(65536)
        assert data, "the connection ended in the middle of an answer"
        return data


Calling = Callable[[str], Caller]


@pytest.fixture
def caller_of() -> Iterator[Calling]:
    """Callers of a URL; their connections are closed at the end."""
    callers: list[Caller] = []

    def call(url: str) -> Caller:
        callers.append(Caller(url))
        return callers[-1]

    yield call
    for caller in callers:
        caller.socket.close()


@pytest.fixture
def url(serve: Serve, mock: OpenAiMock) -> str:
    return serve(build({"m": chat_backend(mock)}).app)


def test_chats_and_other_requests_take_turns_on_one_connection(caller_of: Calling, url: str) -> None:
    caller = caller_of(url)
    for _ in range(2):
        caller.send(post(chat()))
        assert caller.answer()[0] == 200
        caller.send(b"GET /healthz HTTP/1.1\r\nhost: gateway\r\n\r\n")
        assert json.loads(caller.answer()[2])["status"] == "ok"


def test_requests_sent_before_the_last_answer_are_answered_in_their_order(
    caller_of: Calling, url: str, mock: OpenAiMock
) -> None:
    mock.will(says("slow", after_s=0.3), says("quick"))
    caller = caller_of(url)
    other = b"GET /healthz HTTP/1.1\r\nhost: gateway\r\n\r\n"
    caller.send(post(chat("first")), other, post(chat("second " * 40_000)), other, post(chat("third")))
    answers = [caller.answer() for _ in range(5)]
    assert [status for status, _, _ in answers] == [200] * 5
    said = [json.loads(answers[at][2])["choices"][0]["message"]["content"] for at in (0, 2, 4)]
    assert said == ["slow", "quick", "quick"]
    assert [asked.body["messages"][0]["content"][:5] for asked in mock.asked] == ["first", "secon", "third"]


def test_a_body_may_come_in_any_pieces_and_after_a_pause(caller_of: Calling, url: str, mock: OpenAiMock) -> None:
    caller = caller_of(url)
    request = post(chat("x" * 300_000))
    for cut in (1, 40, 200, 70_000, 299_000):
        caller = caller_of(url)
        caller.send(request[:cut])
        time.sleep(0.05)
        caller.send(request[cut:])
        assert caller.answer()[0] == 200
    body = chat()
    chunks = b"".join(b"%x\r\n%c\r\n" % (1, byte) for byte in body) + b"0\r\n\r\n"
    caller.send(f"POST {PATH} HTTP/1.1\r\nhost: gateway\r\ntransfer-encoding: chunked\r\n\r\n".encode(), chunks)
    assert caller.answer()[0] == 200
    assert len(mock.asked) == 6


def test_a_client_that_asks_whether_to_go_on_is_told_to(caller_of: Calling, url: str) -> None:
    caller = caller_of(url)
    head, separator, body = post(chat(), "expect: 100-continue").partition(b"\r\n\r\n")
    caller.send(head, separator)
    assert caller.answer()[0] == 100
    caller.send(body)
    assert caller.answer()[0] == 200


@pytest.mark.parametrize(("line", "version"), [("connection: close", "1.1"), ("accept: */*", "1.0")])
def test_the_connection_ends_where_the_client_says_so(caller_of: Calling, url: str, line: str, version: str) -> None:
    caller = caller_of(url)
    caller.send(post(chat(), line, version=version))
    status, headers, _ = caller.answer()
    assert (status, headers["connection"]) == (200, "close")
    assert caller.ends()


@pytest.mark.parametrize("target", [PATH + "?a=1", "/v1/chat%2Fcompletions", "http://gateway" + PATH])
def test_the_same_address_written_otherwise_is_the_same(caller_of: Calling, url: str, target: str) -> None:
    caller = caller_of(url)
    caller.send(post(chat(), target=target))
    status, headers, _ = caller.answer()
    assert (status, headers["x-cache"]) == (200, "off")

    caller = caller_of(url)
    caller.send(f"GET {PATH} HTTP/1.1\r\nhost: gateway\r\n\r\n".encode())
    assert caller.answer()[0] == 405
    caller = caller_of(url)
    caller.send(b"POST nowhere\r\nhost\r\n\r\n")
    assert b"400" in caller.socket.recv(65536)


def test_a_wrong_body_leaves_the_connection_to_the_next_request(caller_of: Calling, url: str) -> None:
    caller = caller_of(url)
    caller.send(post(b"{"))
    assert caller.answer()[0] == 422
    caller.send(post(chat()))
    assert caller.answer()[0] == 200


def test_a_request_refused_before_its_body_came_leaves_the_connection_in_step(caller_of: Calling, url: str) -> None:
    caller = caller_of(url)
    request = post(chat("x" * 100_000), "x-timeout-s: soon")
    caller.send(request[:500])
    assert caller.answer()[0] == 422
    caller.send(request[500:], post(chat()))
    assert caller.answer()[0] == 200


def test_a_body_that_does_not_come_is_not_waited_for(caller_of: Calling, serve: Serve, mock: OpenAiMock) -> None:
    caller = caller_of(serve(build({"m": chat_backend(mock)}).app, ConnectionLimits(100, body_within_s=0.2)))
    caller.send(post(chat())[:-1])
    status, _, body = caller.answer()
    assert (status, json.loads(body)["error"]["code"]) == (408, "slow_body")
    assert caller.ends()


@pytest.mark.parametrize("ahead", [False, True])
def test_a_caller_who_leaves_ends_the_call(caller_of: Calling, serve: Serve, mock: OpenAiMock, ahead: bool) -> None:
    mock.will(hangs())
    backend = chat_backend(mock, timeout_s=60.0, concurrency=1)
    url = serve(build({"m": backend}).app)
    caller = caller_of(url)
    caller.send(post(chat()), post(chat()) if ahead else b"")
    wait_until(lambda: len(mock.asked) == 1)
    assert backend.upstream.admission.running == 1
    caller.socket.close()
    wait_until(lambda: backend.upstream.admission.running == 0)
    wait_until(lambda: metric(url, "http_requests_total", route=PATH, status="499") == 1)
    assert metric(url, "vlm_gateway_calls_total", outcome="caller_left") == 1
    assert len(mock.asked) == 1


def test_a_reader_who_stops_reading_holds_the_stream_up(
    caller_of: Calling, serve: Serve, mock: OpenAiMock, tmp_path: Path
) -> None:
    mock.will(streams(*["x" * 100_000] * 300))  # more than all buffers between the two hold
    backend = chat_backend(mock)
    url = serve(build({"m": backend}, cache=sqlite_cache(tmp_path)).app)
    caller = caller_of(url)
    caller.send(post(chat(stream=True)))
    assert caller.socket.recv(100).startswith(b"HTTP/1.1 200 OK")
    time.sleep(0.5)
    assert backend.upstream.admission.running == 1  # it waits for its reader
    received, tail = 0, b""
    while not tail.endswith(b"\r\n0\r\n\r\n"):
        data = caller.socket.recv(1 << 20)
        received, tail = received + len(data), (tail + data)[-7:]
    assert received > 30_000_000


def test_whoever_is_being_answered_when_the_service_ends_gets_the_answer(caller_of: Calling, mock: OpenAiMock) -> None:
    mock.will(says("hello", after_s=0.6))
    backend = chat_backend(mock)
    server = uvicorn.Server(server_config(build({"m": backend}).app, "127.0.0.1", free_port(), 5))
    thread = threading.Thread(target=server.run)
    thread.start()
    wait_until(lambda: server.started)
    caller, idle = (caller_of(f"http://127.0.0.1:{server.config.port}") for _ in range(2))
    caller.send(post(chat()))
    wait_until(lambda: backend.upstream.admission.running == 1)
    server.should_exit = True
    assert caller.answer()[0] == 200
    assert caller.ends()
    assert idle.ends()
    thread.join(10)
    assert not thread.is_alive()


def test_many_bodies_are_never_mixed_up(caller_of: Calling, url: str, mock: OpenAiMock) -> None:
    callers = [caller_of(url) for _ in range(20)]
    requests = [post(chat(f"{number} " * 20_000)) for number in range(20)]
    for cut in range(0, max(map(len, requests)), 30_000):
        for caller, request in zip(callers, requests, strict=True):
            caller.send(request[cut : cut + 30_000])
    assert [caller.answer()[0] for caller in callers] == [200] * 20
    firsts = sorted(int(asked.body["messages"][0]["content"].split()[0]) for asked in mock.asked)
    assert firsts == list(range(20))
    assert httpx.get(url + "/healthz", timeout=60).status_code == 200


def test_web_pages_of_listed_origins_may_chat_and_others_only_as_programs_do(serve: Serve, mock: OpenAiMock) -> None:
    url = serve(build({"m": chat_backend(mock)}, origins=Origins(["https://ground.example"])).app)
    asks = {"origin": "https://ground.example", "access-control-request-method": "POST"}
    assert httpx.options(url + PATH, headers=asks).headers["access-control-allow-origin"] == "https://ground.example"
    mine = httpx.post(url + PATH, content=chat(), headers={"origin": "https://ground.example"}, timeout=60)
    assert (mine.status_code, mine.headers["access-control-allow-origin"]) == (200, "https://ground.example")
    wrong = httpx.post(url + PATH, content=b"{}", headers={"origin": "https://ground.example"}, timeout=60)
    assert (wrong.status_code, wrong.headers["access-control-allow-origin"]) == (422, "https://ground.example")
    foreign = {"origin": "https://evil.example", "content-type": "text/plain"}
    refused = httpx.post(url + PATH, content=chat(), headers=foreign, timeout=60)
    assert (refused.status_code, refused.json()["error"]["code"]) == (415, "unsupported_media_type")
    assert "access-control-allow-origin" not in refused.headers


def test_a_chat_sent_as_gzip_is_answered(serve: Serve, mock: OpenAiMock) -> None:
    url = serve(build({"m": chat_backend(mock)}).app)
    packed = {"content-encoding": "gzip"}
    answer = httpx.post(url + PATH, content=gzip.compress(chat("packed")), headers=packed, timeout=60)
    assert (answer.status_code, mock.asked[-1].body["messages"][0]["content"]) == (200, "packed")
    assert httpx.post(url + PATH, content=b"no gzip", headers=packed, timeout=60).status_code == 400


@pytest.mark.parametrize("breaks", [False, True])
def test_a_stream_to_a_caller_who_knows_no_chunks_ends_with_its_connection(
    caller_of: Calling, url: str, mock: OpenAiMock, breaks: bool
) -> None:
    mock.will(streams("one", "two", done=not breaks))
    caller = caller_of(url)
    caller.send(post(chat(stream=True), version="1.0"))
    whole = b""
    while data := caller.socket.recv(65536):
        whole += data
    head, _, body = whole.partition(b"\r\n\r\n")
    assert b"transfer-encoding" not in head
    assert b"connection: close" in head
    assert body.strip().startswith(b"data: {")
    assert body.endswith(b"data: [DONE]\n\n") is not breaks
    assert (b'"error"' in body) is breaks
