"""Who leaves before an answer is there: a caller, whose work is given up; or the service, which says so."""

import asyncio
from collections.abc import Coroutine
from typing import Any, TypeVar

from starlette.requests import ClientDisconnect, Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from contracts.errors import STOPPING
from service_kit.errors import error_response

T = TypeVar("T")


class Stopping:
    """ASGI middleware: a request that is cut off because the service stops, and its time for that is over, is answered
    with 503 where its answer has not begun."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        begun = False

        async def watched(message: Message) -> None:
            nonlocal begun
            begun = True
            await send(message)

        try:
            await self._app(scope, receive, watched)
        except asyncio.CancelledError:
            task = asyncio.current_task()
            if begun or task is None:
                raise
            task.uncancel()
            message = "the service stops and could not finish this in time; ask again"
            headers = {"connection": "close", "retry-after": "1"}
            await error_response(503, STOPPING, message, headers=headers)(scope, receive, send)


async def while_asked(request: Request, work: Coroutine[Any, Any, T]) -> T:
    """What `work` brings; it is cancelled when the caller closes its connection. The request's body must have been
    read. Raises ClientDisconnect then, and what `work` raises."""
    job = asyncio.create_task(work)
    left = asyncio.create_task(_left(request))
    try:
        await asyncio.wait({job, left}, return_when=asyncio.FIRST_COMPLETED)
        if not job.done():
            raise ClientDisconnect
        return job.result()
    finally:
        job.cancel()
        left.cancel()
        await asyncio.gather(job, left, return_exceptions=True)


async def _left(request: Request) -> None:
    while (await request.receive())["type"] != "http.disconnect":
        pass
