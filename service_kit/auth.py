"""Who may call: a guard in front of a service, and the one that asks for a shared token."""

import hmac
from typing import Any, NamedTuple, Protocol, cast

from starlette.types import ASGIApp, Receive, Scope, Send

from contracts.health import Access
from service_kit.errors import ServiceError, Unauthorised, error_response

OPEN_PATHS = frozenset({"/healthz", "/readyz"})
_ACCESS = "logisticsvln.access"


class Judgement(NamedTuple):
    """What a request's credentials are worth, and the error to refuse it with, if it is refused."""

    access: Access
    refusal: ServiceError | None = None


class Guard(Protocol):
    """Decides over HTTP requests by their head."""

    def judge(self, scope: Scope) -> Judgement: ...


def access_of(scope: Scope) -> Access:
    """What was found out about the request's token."""
    return cast(Access, scope.get(_ACCESS, "open"))


def note_access(scope: Scope, access: Access) -> None:
    """Keeps with the request what was found out about its token."""
    scope[_ACCESS] = access


def is_guarded(app: ASGIApp) -> bool:
    """Whether an app asks its callers for a token: its own `guarded`, or its state's, as `create_app` sets it."""
    state: Any = getattr(app, "state", None)
    return bool(getattr(app, "guarded", getattr(state, "guarded", False)))


def bearer_token(scope: Scope) -> str | None:
    """What stands in `Authorization: Bearer <token>`; an empty string for another kind of credentials."""
    given: bytes | None = next((v for k, v in scope["headers"] if k == b"authorization"), None)
    if given is None:
        return None
    kind, _, token = given.partition(b" ")
    return token.strip().decode("latin-1") if kind.lower() == b"bearer" else ""


def same(given: str, expected: str) -> bool:
    """In constant time."""
    return hmac.compare_digest(given.encode(), expected.encode())


def ask_for_token() -> Unauthorised:
    message = "send the service's token as 'Authorization: Bearer <token>'"
    return Unauthorised(message, headers={"www-authenticate": "Bearer"})


class TokenGuard:
    """One token opens everything."""

    def __init__(self, token: str) -> None:
        self._token = token

    def judge(self, scope: Scope) -> Judgement:
        given = bearer_token(scope)
        if given is not None and same(given, self._token):
            return Judgement("granted")
        return Judgement("missing_token" if given is None else "wrong_token", ask_for_token())


class Guarded:
    """ASGI middleware: answers what the guard refuses. Health stays open, and says what the token is worth."""

    def __init__(self, app: ASGIApp, guard: Guard) -> None:
        self._app = app
        self._guard = guard

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "http":
            access, refusal = self._guard.judge(scope)
            if refusal is not None and scope["path"] not in OPEN_PATHS:
                answer = error_response(refusal.status, refusal.code, refusal.message, headers=refusal.headers)
                await answer(scope, receive, send)
                return
            note_access(scope, access)
        await self._app(scope, receive, send)
