"""What callers may send in more ways than one: HEAD for GET, compressed bodies, JSON under another name, other origins.

A web page may send JSON anywhere without asking, as long as it calls it text/plain. So JSON under another name is
taken from programs and from this server's own pages, and refused (415) from pages of foreign origins; under its own
name their browsers ask first (CORS), and only the configured origins are told yes.
"""

import asyncio
import zlib
from collections.abc import Iterable
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service_kit.errors import ServiceError, error_response

EXPOSED = ("x-request-id", "x-model", "x-cache", "x-cost-usd", "retry-after")
_WITH_BODY = frozenset({"POST", "PUT", "PATCH", "DELETE"})
_IN_THREAD_BYTES = 64 * 1024


class UnsupportedMedia(ServiceError):
    """A body in a form that is not read."""

    status = 415
    code = "unsupported_media_type"


class Origins:
    """Which origins' web pages may ask: this server's own and the `allowed` ones; `*` allows all."""

    def __init__(self, allowed: Iterable[str] = ()) -> None:
        self.allowed = frozenset(origin.rstrip("/").lower() for origin in allowed)

    def allows(self, origin: str, host: str) -> bool:
        """`origin` and `host` are the values of the headers of these names."""
        mine = urlsplit(origin).netloc.lower() == host.lower() and bool(host)
        return mine or self.names(origin)

    def names(self, origin: str) -> bool:
        """Whether it is among the allowed ones."""
        return "*" in self.allowed or origin.lower() in self.allowed

    def check(self, content_type: str | None, origin: str | None, host: str | None) -> None:
        """Raises UnsupportedMedia where a foreign page sends JSON under another name."""
        if origin is None or is_json(content_type) or self.allows(origin, host or ""):
            return
        raise UnsupportedMedia(
            f"from a page of {origin[:80]!r}, JSON is taken as 'content-type: application/json' only; "
            "programs may leave the type out"
        )


def is_json(content_type: str | None) -> bool:
    """Whether a content type says JSON."""
    kind = (content_type or "").partition(";")[0].strip().lower()
    return kind == "application/json" or (kind.startswith("application/") and kind.endswith("+json"))


def inflated(data: bytes, encoding: str, max_bytes: int) -> bytes:
    """A body without its compression. Raises UnsupportedMedia, or ServiceError where it is broken or over
    `max_bytes`."""
    if encoding not in ("gzip", "x-gzip", "deflate"):
        raise UnsupportedMedia(f"content-encoding {encoding[:40]!r} is not read; send gzip, deflate or no compression")
    unpack = zlib.decompressobj(wbits=47)  # gzip and zlib, told apart by their heads
    try:
        body = unpack.decompress(data, max_bytes + 1)
    except zlib.error as error:
        raise ServiceError(f"the body is not {encoding}: {error}", code="bad_encoding", status=400) from None
    if len(body) > max_bytes:
        message = f"the body is over this route's limit of {max_bytes} bytes when unpacked; send less"
        raise ServiceError(message, code="body_too_large", status=413)
    if not unpack.eof:
        raise ServiceError(f"the {encoding} body ends too early", code="bad_encoding", status=400)
    return body


async def without_encoding(data: bytes, encoding: str | None, max_bytes: int) -> bytes:
    """`inflated`, where there is anything to unpack; large bodies in a thread."""
    said = (encoding or "identity").strip().lower()
    if said in ("", "identity"):
        return data
    if len(data) < _IN_THREAD_BYTES:
        return inflated(data, said, max_bytes)
    return await asyncio.to_thread(inflated, data, said, max_bytes)


class RequestForms:
    """ASGI middleware: HEAD is answered as GET without its body, compressed bodies are unpacked within `max_bytes`, and
    JSON may go under another name unless a foreign page sends it."""

    def __init__(self, app: ASGIApp, origins: Origins, max_bytes: int) -> None:
        self._app = app
        self._origins = origins
        self._max_bytes = max_bytes

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
        elif scope["method"] == "HEAD":
            await self._app({**scope, "method": "GET"}, receive, send)  # the server below leaves the body out
        elif scope["method"] in _WITH_BODY:
            try:
                scope, receive = await self._plain(scope, receive)
            except ServiceError as error:
                answer = error_response(error.status, error.code, error.message, error.details, error.headers)
                await answer(scope, receive, send)
                return
            await self._app(scope, receive, send)
        else:
            await self._app(scope, receive, send)

    async def _plain(self, scope: Scope, receive: Receive) -> tuple[Scope, Receive]:
        said = Headers(scope=scope)
        kind = said.get("content-type")
        encoding = said.get("content-encoding")
        self._origins.check(kind, said.get("origin"), said.get("host"))
        if is_json(kind) and encoding is None:
            return scope, receive
        headers = MutableHeaders(raw=list(scope["headers"]))
        headers["content-type"] = "application/json"
        scope = {**scope, "headers": headers.raw}
        if encoding is None:
            return scope, receive
        body = await without_encoding(await _read(receive), encoding, self._max_bytes)
        del headers["content-encoding"]
        headers["content-length"] = str(len(body))
        return scope, _once(body, receive)


async def _read(receive: Receive) -> bytes:
    parts = []
    while True:
        message = await receive()
        if message["type"] != "http.request":
            raise ServiceError("the caller left before its body was through", code="caller_left", status=499)
        parts.append(message.get("body", b""))
        if not message.get("more_body", False):
            return b"".join(parts)


def _once(body: bytes, after: Receive) -> Receive:
    """Gives `body`, then what comes after it."""
    given = False

    async def receive() -> Message:
        nonlocal given
        if given:
            return await after()
        given = True
        return {"type": "http.request", "body": body, "more_body": False}

    return receive
