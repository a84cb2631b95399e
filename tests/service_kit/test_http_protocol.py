"""A service's connections, byte by byte: offers of other protocols, and callers that hang. Over real sockets."""

import asyncio
import contextlib
import gzip
import json
import re
import socket
import time
from collections.abc import AsyncIterator, Callable, Iterator

import httpx
import pytest
from fastapi import FastAPI
from fastapi.responses import StreamingResponse

from contracts.base import Wire
from service_kit.app import create_app
from service_kit.http_limits import ConnectionLimits
from service_kit.requests import Origins
from tests.conftest import Serve

H2C = ("connection: Upgrade, HTTP2-Settings", "upgrade: h2c", "http2-settings: AAMAAABkAAQAoAAAAAIAAAAA")


class Echo(Wire):
    text: str


def echo_app(origins: Origins | None = None) -> FastAPI:
    app = create_app("echo", max_body_bytes=4_000_000, origins=origins)

    @app.post("/v1/echo")
    async def echo(message: Echo) -> Echo:
        return message

    @app.get("/v1/slow")
    async def slow() -> Echo:
        await asyncio.sleep(0.5)
        return Echo(text="slow")

    @app.get("/v1/much")
    async def much() -> StreamingResponse:
        async def pieces() -> AsyncIterator[bytes]:
            for _ in range(400):
                yield b"x" * 100_000

        return StreamingResponse(pieces())

    return app


@pytest.fixture(scope="module")
def url(serve: Serve) -> str:
    return serve(echo_app(Origins(["https://ground.example"])))


Connect = Callable[[str], socket.socket]


@pytest.fixture
def connected() -> Iterator[Connect]:
    """Connections to a URL, with small windows; closed at the end."""
    lines: list[socket.socket] = []

    def connect(url: str) -> socket.socket:
        host, port = url.removeprefix("http://").split(":")
        line = socket.socket()
        lines.append(line)
        line.settimeout(30)
        line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 16_384)
        line.connect((host, int(port)))
        return line

    yield connect
    for line in lines:
        line.close()


def rest_of(line: socket.socket) -> bytes:
    """All that comes until the connection ends, in whatever way."""
    got = b""
    with contextlib.suppress(ConnectionError):
        while data := line.recv(1 << 20):
            got += data
    return got


def request(body: bytes, *lines: str, chunked: bool = False) -> bytes:
    framing = "transfer-encoding: chunked" if chunked else f"content-length: {len(body)}"
    head = "\r\n".join(["POST /v1/echo HTTP/1.1", "host: x", "content-type: application/json", framing, *lines])
    return head.encode() + b"\r\n\r\n" + (b"%x\r\n%s\r\n0\r\n\r\n" % (len(body), body) if chunked else body)


def said(text: str) -> bytes:
    return json.dumps({"text": text}).encode()


def read_until(line: socket.socket, count: int) -> bytes:
    """What comes until `count` answers were seen to begin and the last is whole, or the connection ends."""
    got = b""
    while data := line.recv(65536):
        got += data
        if got.count(b"HTTP/1.1 ") >= count and re.search(rb"}[\s]*$", got):
            break
    return got


@pytest.mark.parametrize("chunked", [False, True])
@pytest.mark.parametrize("cut", [1, 60, 10_000])
def test_an_offer_of_http2_is_ignored_and_the_body_read(connected: Connect, url: str, chunked: bool, cut: int) -> None:
    line = connected(url)
    whole = request(said("one"), *H2C, chunked=chunked) + request(said("two")) + request(said("three"), *H2C)
    for at in range(0, len(whole), cut):
        line.sendall(whole[at : at + cut])
    answers = read_until(line, 3)
    assert answers.count(b"HTTP/1.1 200 OK") == 3
    assert [text for text in (b"one", b"two", b"three") if text in answers] == [b"one", b"two", b"three"]


def test_other_tokens_of_connection_survive_the_ignored_offer(connected: Connect, url: str) -> None:
    line = connected(url)
    line.sendall(request(said("last"), "connection: close, Upgrade", "upgrade: h2c"))
    answer = rest_of(line)
    assert b"200 OK" in answer
    assert b"connection: close" in answer


def test_connect_is_refused_without_a_loop(connected: Connect, url: str) -> None:
    line = connected(url)
    line.sendall(b"CONNECT other.example:443 HTTP/1.1\r\nhost: other.example:443\r\n\r\n")
    assert line.recv(65536).startswith(b"HTTP/1.1 405")


@pytest.mark.parametrize(
    "sent",
    [b"", b"\r\n\r\n", b"POST /v1/echo HTTP/1.1\r\nhost: x\r\n"],
    ids=["nothing", "line breaks", "half a head"],
)
def test_a_head_that_never_ends_is_not_waited_for(connected: Connect, serve: Serve, sent: bytes) -> None:
    line = connected(serve(echo_app(), ConnectionLimits(100, head_within_s=0.3)))
    began = time.monotonic()
    line.sendall(sent)
    got = rest_of(line)
    assert got == b""
    assert 0.2 < time.monotonic() - began < 10


@pytest.mark.parametrize(
    "begun", [b"", b"transfer-encoding: chunked\r\n\r\n2\r\n{}\r\n0\r\n"], ids=["head", "trailers"]
)
def test_a_head_and_trailers_are_bounded(connected: Connect, url: str, begun: bytes) -> None:
    line = connected(url)
    line.sendall(b"POST /v1/echo HTTP/1.1\r\nhost: x\r\n" + begun)
    with contextlib.suppress(ConnectionError):
        for number in range(400):
            line.sendall(b"x-%d: " % number + b"a" * 100_000 + b"\r\n")
        pytest.fail("40 MB of head were taken")
    assert httpx.get(url + "/healthz").status_code == 200


def test_a_head_that_is_too_large_is_told_so(connected: Connect, url: str) -> None:
    line = connected(url)
    line.sendall(b"GET /healthz HTTP/1.1\r\nhost: x\r\n")
    time.sleep(0.1)
    line.sendall(b"cookie: " + b"a" * 66_000)
    assert rest_of(line).startswith(b"HTTP/1.1 431 ")


def test_extensions_of_chunks_are_bounded(connected: Connect, url: str) -> None:
    line = connected(url)
    line.sendall(b"POST /v1/echo HTTP/1.1\r\nhost: x\r\ntransfer-encoding: chunked\r\n\r\n")
    with contextlib.suppress(ConnectionError):
        for _ in range(100):
            line.sendall(b"1;" + b"a" * 100_000 + b"\r\n \r\n")
        pytest.fail("10 MB of extensions were taken")


@pytest.mark.parametrize("bytes_a_piece", [7, 5_000])
def test_a_body_in_chunks_of_one_byte_is_within_the_bound(connected: Connect, url: str, bytes_a_piece: int) -> None:
    body = said("x" * 40_000)
    head, _, _ = request(b"", chunked=True).partition(b"0\r\n\r\n")
    sent = b"".join(b"1\r\n%c\r\n" % one for one in body) + b"0\r\n\r\n"
    line = connected(url)
    for at in range(0, len(head + sent), bytes_a_piece * 20):
        line.sendall((head + sent)[at : at + bytes_a_piece * 20])
    assert b"200 OK" in read_until(line, 1)


def test_a_head_that_drips_after_an_answer_is_not_waited_for(connected: Connect, serve: Serve) -> None:
    line = connected(serve(echo_app(), ConnectionLimits(100, head_within_s=0.5)))
    line.sendall(request(said("one")))
    assert b"200 OK" in read_until(line, 1)
    sent = 0
    with contextlib.suppress(ConnectionError):
        for letter in b"POST /v1/echo HTTP/1.1\r\nx: " + b"y" * 1000:
            line.sendall(bytes([letter]))
            sent += 1
            time.sleep(0.02)
    assert sent < 500


def test_a_body_that_never_ends_is_not_waited_for(connected: Connect, serve: Serve) -> None:
    line = connected(serve(echo_app(), ConnectionLimits(100, body_within_s=0.3)))
    line.sendall(request(said("one"))[:-2])
    got = rest_of(line)
    assert got.startswith(b"HTTP/1.1 408")
    assert b'"slow_body"' in got


def test_a_caller_that_stops_reading_is_cut_off(connected: Connect, serve: Serve) -> None:
    line = connected(serve(echo_app(), ConnectionLimits(100, write_within_s=0.5)))
    line.sendall(b"GET /v1/much HTTP/1.1\r\nhost: x\r\n\r\n")
    time.sleep(2.0)
    assert len(rest_of(line)) < 40_000_000


def test_a_slow_reader_that_reads_is_served_to_the_end(connected: Connect, serve: Serve) -> None:
    line = connected(serve(echo_app(), ConnectionLimits(100, write_within_s=0.5)))
    line.sendall(b"GET /v1/much HTTP/1.1\r\nhost: x\r\nconnection: close\r\n\r\n")
    received = 0
    began = time.monotonic()
    while data := line.recv(1 << 20):
        received += len(data)
        if time.monotonic() - began < 3:
            time.sleep(0.05)
    assert received > 40_000_000


def test_at_the_bound_the_connection_idle_for_longest_makes_room(connected: Connect, serve: Serve) -> None:
    where = serve(echo_app(), ConnectionLimits(3))
    idle = [connected(where) for _ in range(3)]
    idle[0].sendall(request(said("one")))
    assert b"200 OK" in read_until(idle[0], 1)  # so the second is idle for longest now
    newcomer = connected(where)
    newcomer.sendall(request(said("new")))
    assert b"200 OK" in read_until(newcomer, 1)
    assert rest_of(idle[1]) == b""
    idle[0].sendall(request(said("still here")))
    assert b"still here" in read_until(idle[0], 1)


def test_at_the_bound_with_everybody_busy_the_newcomer_is_told(connected: Connect, serve: Serve) -> None:
    where = serve(echo_app(), ConnectionLimits(2))
    busy = [connected(where) for _ in range(2)]
    for line in busy:
        line.sendall(b"GET /v1/slow HTTP/1.1\r\nhost: x\r\n\r\n")
    time.sleep(0.2)
    refused = connected(where).recv(65536)
    assert refused.startswith(b"HTTP/1.1 503")
    assert b"too_many_connections" in refused
    assert all(b"slow" in read_until(line, 1) for line in busy)


@pytest.mark.parametrize("chunked", [False, True], ids=["length", "chunked"])
def test_bytes_received_are_bounded_over_all_callers(connected: Connect, serve: Serve, chunked: bool) -> None:
    where = serve(echo_app(), ConnectionLimits(100, max_body_bytes_held=5_000_000))
    block = b"x" * 100_000
    lines = [connected(where) for _ in range(4)]
    for line in lines:
        framing = "transfer-encoding: chunked" if chunked else "content-length: 3000000"
        line.sendall(f"POST /v1/echo HTTP/1.1\r\nhost: x\r\n{framing}\r\n\r\n".encode())
        for _ in range(20):
            line.sendall(b"%x\r\n%s\r\n" % (len(block), block) if chunked else block)
    time.sleep(0.3)
    refused = []
    for line in lines:
        line.setblocking(False)
        try:
            refused.append(line.recv(65536))
        except BlockingIOError:
            continue
    assert 1 <= len(refused) <= 2
    assert all(answer.startswith(b"HTTP/1.1 503") and b"overloaded" in answer for answer in refused)


def test_stated_but_unsent_bytes_keep_nobody_out(connected: Connect, serve: Serve) -> None:
    where = serve(echo_app(), ConnectionLimits(100, max_body_bytes_held=5_000_000))
    for _ in range(10):
        connected(where).sendall(b"POST /v1/echo HTTP/1.1\r\nhost: x\r\ncontent-length: 3900000\r\n\r\n")
    assert httpx.post(where + "/v1/echo", json={"text": "in"}).status_code == 200


def test_a_body_that_stands_still_goes_before_one_that_comes_in(connected: Connect, serve: Serve) -> None:
    where = serve(echo_app(), ConnectionLimits(100, max_body_bytes_held=5_000_000))
    still = connected(where)
    still.sendall(b"POST /v1/echo HTTP/1.1\r\nhost: x\r\ncontent-length: 3900000\r\n\r\n" + b"x" * 3_000_000)
    time.sleep(1.3)
    body = said("y" * 3_000_000)
    answer = httpx.post(where + "/v1/echo", content=body, headers={"content-type": "application/json"})
    assert answer.status_code == 200
    assert still.recv(65536).startswith(b"HTTP/1.1 503")


def test_a_caller_refused_in_the_middle_of_its_body_sees_why(connected: Connect, url: str) -> None:
    line = connected(url)
    line.sendall(b"POST /v1/echo HTTP/1.1\r\nhost: x\r\ncontent-length: 8000000\r\n\r\n")
    for _ in range(80):
        line.sendall(b"x" * 100_000)
    assert line.recv(65536).startswith(b"HTTP/1.1 413")
    line.sendall(request(said("next")))
    assert b"next" in read_until(line, 1)


def test_what_is_no_http_gets_an_error_of_our_shape(connected: Connect, url: str) -> None:
    line = connected(url)
    line.sendall(b"SSH-2.0-OpenSSH_9.6\r\n\r\n")
    status, _, body = line.recv(65536).partition(b"\r\n\r\n")
    assert status.startswith(b"HTTP/1.1 400")
    assert json.loads(body)["error"]["code"] == "bad_request"


def test_head_is_answered_as_get_without_a_body(url: str) -> None:
    asked, headed = httpx.get(url + "/healthz"), httpx.head(url + "/healthz")
    assert (headed.status_code, headed.content) == (200, b"")
    assert headed.headers["content-length"] == asked.headers["content-length"]


def test_gzip_is_read_and_other_encodings_are_named(url: str) -> None:
    packed = gzip.compress(said("packed"))
    answer = httpx.post(url + "/v1/echo", content=packed, headers={"content-encoding": "gzip"})
    assert answer.json() == {"text": "packed"}
    other = httpx.post(url + "/v1/echo", content=packed, headers={"content-encoding": "br"})
    assert (other.status_code, other.json()["error"]["code"]) == (415, "unsupported_media_type")
    bomb = gzip.compress(said("0" * 20_000_000))
    assert len(bomb) < 100_000
    assert httpx.post(url + "/v1/echo", content=bomb, headers={"content-encoding": "gzip"}).status_code == 413
    broken = httpx.post(url + "/v1/echo", content=packed[:-4], headers={"content-encoding": "gzip"})
    assert (broken.status_code, broken.json()["error"]["code"]) == (400, "bad_encoding")


@pytest.mark.parametrize(
    "kind", [None, "text/plain", "application/x-www-form-urlencoded", "application/json; charset=utf-8"]
)
def test_json_under_another_name_is_taken_from_programs(url: str, kind: str | None) -> None:
    headers = {} if kind is None else {"content-type": kind}
    assert httpx.post(url + "/v1/echo", content=said("hi"), headers=headers).json() == {"text": "hi"}


@pytest.mark.parametrize(
    ("origin", "kind", "status"),
    [
        ("https://evil.example", "text/plain", 415),
        ("null", "text/plain", 415),
        ("https://evil.example", "application/json", 200),
        ("https://ground.example", "text/plain", 200),
        ("own", "text/plain", 200),
    ],
)
def test_json_under_another_name_is_refused_from_foreign_pages_only(
    url: str, origin: str, kind: str, status: int
) -> None:
    headers = {"origin": url if origin == "own" else origin, "content-type": kind}
    assert httpx.post(url + "/v1/echo", content=said("hi"), headers=headers).status_code == status


def test_pages_of_listed_origins_are_told_they_may_ask_and_others_not(url: str) -> None:
    asks = {"access-control-request-method": "POST", "access-control-request-headers": "content-type, authorization"}
    mine = httpx.options(url + "/v1/echo", headers={"origin": "https://ground.example", **asks})
    assert (mine.status_code, mine.headers["access-control-allow-origin"]) == (200, "https://ground.example")
    other = httpx.options(url + "/v1/echo", headers={"origin": "https://evil.example", **asks})
    assert "access-control-allow-origin" not in other.headers
