"""One shared bearer token in front of a service, where its operator sets one."""

import hmac

from starlette.types import ASGIApp, Receive, Scope, Send

from service_kit.errors import error_response

OPEN_PATHS = frozenset({"/healthz", "/readyz"})


class BearerAuth:
    """ASGI middleware: 401 without `Authorization: Bearer <token>`, compared in constant time; health stays open."""

    def __init__(self, app: ASGIApp, token: str) -> None:
        self._app = app
        self._expected = b"Bearer " + token.encode()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "http" and scope["path"] not in OPEN_PATHS:
            given = next((v for k, v in scope["headers"] if k == b"authorization"), b"")
            if not hmac.compare_digest(given, self._expected):
                answer = error_response(
                    401,
                    "unauthorised",
                    "send the service's token as 'Authorization: Bearer <token>'",
                    headers={"www-authenticate": "Bearer"},
                )
                await answer(scope, receive, send)
                return
        await self._app(scope, receive, send)
