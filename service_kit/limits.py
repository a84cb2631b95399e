"""Bounds on what comes in, kept while it streams in: nothing over the limit is ever held in memory."""

import contextlib

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service_kit.errors import error_response


class BodyLimit:
    """ASGI middleware: answers 413 as soon as a body states or reaches more than `max_bytes`."""

    def __init__(self, app: ASGIApp, max_bytes: int) -> None:
        self._app = app
        self._max_bytes = max_bytes

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        stated = next((v for k, v in scope["headers"] if k == b"content-length"), b"0")
        if not stated.isdigit() or int(stated) > self._max_bytes:
            await self._refuse(scope, receive, send)
            return
        seen = 0
        over = False
        started = False

        async def counted() -> Message:
            nonlocal seen, over
            message = await receive()
            if message["type"] == "http.request":
                seen += len(message.get("body", b""))
                if seen > self._max_bytes:
                    over = True
                    raise _TooLarge
            return message

        async def watched(message: Message) -> None:
            nonlocal started
            if over and not started:
                return  # the framework's own answer to the broken-off body gives way to ours
            started = started or message["type"] == "http.response.start"
            await send(message)

        with contextlib.suppress(_TooLarge):
            await self._app(scope, counted, watched)
        if over and not started:
            await self._refuse(scope, receive, send)

    async def _refuse(self, scope: Scope, receive: Receive, send: Send) -> None:
        answer = error_response(
            413, "body_too_large", f"the body is over this route's limit of {self._max_bytes} bytes; send less"
        )
        if any(name == b"expect" for name, _ in scope["headers"]):
            answer.headers["connection"] = "close"  # the caller may leave its body out, and nobody could tell
        await answer(scope, receive, send)


class _TooLarge(Exception):
    """The body went over the limit while it was read."""
