"""Who may do what: tokens of programs, sessions of browsers, and links of customers."""

import contextlib
import os
import secrets
from collections.abc import Callable
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from typing import Any, cast

from itsdangerous import BadSignature, Signer, URLSafeTimedSerializer
from starlette.requests import Request
from starlette.types import Scope

from contracts.access import Role
from service_kit.auth import Judgement, ask_for_token, bearer_token, same
from service_kit.errors import Forbidden, ServiceError
from service_kit.requests import Origins
from service_kit.settings import BadSetting

SESSION_COOKIE = "session"
CUSTOMER_COOKIE = "customer"
SAFE_METHODS = frozenset({"GET", "HEAD", "OPTIONS"})
KEY_FILE = ".signing-key"
CUSTOMERS_PAGES = "/c/"
ASSETS = "/pages/"
_PAGES = frozenset({("GET", "/"), ("HEAD", "/"), ("GET", "/login"), ("HEAD", "/login"), ("POST", "/v1/session")})
"""What everybody may ask: pages without anything of a delivery in them, and logging in."""


class Access:
    """Tokens and what is signed for them. `operator` and `reader` are tokens; without any, everybody may do everything.
    `key` is asked for when something is signed or looked at for the first time.

    Raises BadSetting for a reader's token without an operator's: it would guard nothing.
    """

    def __init__(self, operator: str | None, reader: str | None, key: Callable[[], str], session_s: int) -> None:
        if reader is not None and operator is None:
            raise BadSetting(
                "ORCHESTRATOR_READ_TOKEN is set without ORCHESTRATOR_TOKEN, so that all may do everything; set both"
            )
        tokens: dict[Role, str | None] = {"operator": operator, "read_only": reader}
        self._tokens = {role: token for role, token in tokens.items() if token is not None}
        self.session_s = session_s
        self._key = key

    @property
    def asked(self) -> bool:
        """Whether anybody is asked for a token."""
        return bool(self._tokens)

    def role_of_token(self, token: str) -> Role | None:
        return next((role for role, known in self._tokens.items() if same(token, known)), None)

    def session(self, role: Role) -> str:
        """The cookie of a session; a changed token or key ends it."""
        return self._sessions.dumps({"role": role, "mark": self._mark(role)})

    def role_of_session(self, cookie: str) -> Role | None:
        try:
            said: Any = self._sessions.loads(cookie, max_age=self.session_s)
        except BadSignature:
            return None
        role = cast(Role, said["role"])
        return role if role in self._tokens and said["mark"] == self._mark(role) else None

    def link(self, delivery_id: str) -> str:
        """What opens one delivery to its customer."""
        return self._links.sign(delivery_id).decode()

    def delivery_of(self, link: str) -> str | None:
        """The delivery that a link opens; null where it is none of ours."""
        try:
            return self._links.unsign(link).decode()
        except BadSignature:
            return None

    @cached_property
    def _sessions(self) -> URLSafeTimedSerializer:
        return URLSafeTimedSerializer(self._key(), salt="session", signer_kwargs={"digest_method": sha256})

    @cached_property
    def _links(self) -> Signer:
        return Signer(self._key(), salt="customer's link", digest_method=sha256)

    @cached_property
    def _marks(self) -> Signer:
        return Signer(self._key(), salt="mark of a token", digest_method=sha256)

    def _mark(self, role: Role) -> str:
        return self._marks.get_signature(self._tokens[role]).decode()


EVERYBODY = Access(None, None, lambda: secrets.token_urlsafe(32), 0)
"""Nobody is asked for a token."""


class RoleGuard:
    """Whether a request may be served."""

    def __init__(self, access: Access) -> None:
        self._access = access

    def judge(self, scope: Scope) -> Judgement:
        request = Request(scope)
        token = bearer_token(scope)
        if token is not None:
            role = self._access.role_of_token(token)
            if role is None:
                return Judgement("wrong_token", ask_for_token())
            return Judgement("granted", _in(role, request))
        role = self._access.role_of_session(request.cookies.get(SESSION_COOKIE, ""))
        if role is not None:
            return Judgement("granted", _foreign(request) or _in(role, request))
        page = request.method in SAFE_METHODS and request.url.path.startswith((CUSTOMERS_PAGES, ASSETS))
        if page or (request.method, request.url.path) in _PAGES:
            return Judgement("missing_token")
        delivery_id = self._access.delivery_of(request.cookies.get(CUSTOMER_COOKIE, ""))
        if delivery_id is not None:
            return Judgement("granted", _foreign(request) or _of_customer(delivery_id, request))
        return Judgement("missing_token", ask_for_token())


def _in(role: Role, request: Request) -> ServiceError | None:
    """What a role may not do."""
    if role == "read_only" and request.method not in SAFE_METHODS and request.url.path != "/v1/session":
        return Forbidden("this token may look on only; changes need the operator's", code="read_only")
    return None


def _of_customer(delivery_id: str, request: Request) -> ServiceError | None:
    """What the customer of a delivery may not do."""
    own, path = f"/v1/deliveries/{delivery_id}", request.url.path
    looks = request.method in SAFE_METHODS and (path == f"{own}/tracking" or path.startswith(f"{own}/tracking/"))
    if looks or (request.method, path) == ("POST", f"{own}/answer"):
        return None
    return Forbidden(f"this link shows the delivery {delivery_id} and takes its answers, nothing else", code="customer")


def _foreign(request: Request) -> ServiceError | None:
    """A change that a browser sends with our cookie, but not from a page of ours."""
    if request.method in SAFE_METHODS:
        return None
    origin, site = request.headers.get("origin"), request.headers.get("sec-fetch-site")
    ours = Origins().allows(origin, request.headers.get("host", "")) if origin else site == "same-origin"
    if ours:
        return None
    return Forbidden(
        "with a session's cookie changes are taken from the viewer's own pages only; programs send a token",
        code="foreign_page",
    )


def signing_key(given: str | None, folder: Path) -> str:
    """The given one, or one that was drawn once and lies in the records' folder, for whoever shares that. Raises
    BadSetting where it can't be kept."""
    if given is not None:
        return given
    path = folder / KEY_FILE
    try:
        if not path.exists():
            folder.mkdir(parents=True, exist_ok=True)
            draft = folder / f"{KEY_FILE}.{secrets.token_hex(4)}"
            draft.touch(mode=0o600)
            draft.write_text(secrets.token_urlsafe(32), encoding="ascii")
            with contextlib.suppress(FileExistsError):
                os.link(draft, path)  # whole or not at all, and the first one wins
            draft.unlink()
        return path.read_text(encoding="ascii").strip()
    except OSError as error:
        raise BadSetting(f"{path}: {error.strerror}; make the folder writable, or set ORCHESTRATOR_KEY") from None
