"""One shared bearer token in front of a service, where its operator sets one."""

import hmac
from typing import cast

from starlette.types import ASGIApp, Receive, Scope, Send

from contracts.health import Access
from service_kit.errors import error_response

OPEN_PATHS = frozenset({"/healthz", "/readyz"})
_ACCESS = "logisticsvln.access"


def access_of(scope: Scope) -> Access:
    """What was found out about the request's token."""
    return cast(Access, scope.get(_ACCESS, "open"))


def note_access(scope: Scope, access: Access) -> None:
    """Keeps with the request what was found out about its token."""
    scope[_ACCESS] = access


class BearerAuth:
    """ASGI middleware: 401 without `Authorization: Bearer <token>`, compared in constant time. Health stays open, and
    says what the token is worth."""

    def __init__(self, app: ASGIApp, token: str) -> None:
        self._app = app
        self._expected = b"Bearer " + token.encode()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "http":
            access = self._access(scope)
            if access != "granted" and scope["path"] not in OPEN_PATHS:
                answer = error_response(
                    401,
                    "unauthorised",
                    "send the service's token as 'Authorization: Bearer <token>'",
                    headers={"www-authenticate": "Bearer"},
                )
                await answer(scope, receive, send)
                return
            note_access(scope, access)
        await self._app(scope, receive, send)

    def _access(self, scope: Scope) -> Access:
        given = next((v for k, v in scope["headers"] if k == b"authorization"), b"")
        if not given:
            return "missing_token"
        return "granted" if hmac.compare_digest(given, self._expected) else "wrong_token"
