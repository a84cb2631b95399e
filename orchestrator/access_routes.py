"""Logging in, logging out, and the pages of customers."""

from collections.abc import Awaitable, Callable
from typing import Any

from fastapi import FastAPI, Request, Response
from fastapi.responses import HTMLResponse, RedirectResponse

from contracts.access import CustomerLink, Role, Session, SessionQuestion
from orchestrator.access import ASSETS, CUSTOMER_COOKIE, CUSTOMERS_PAGES, SESSION_COOKIE, Access
from orchestrator.pages import asset, page
from service_kit.auth import access_of, bearer_token
from service_kit.errors import NotFound, Unauthorised, error_answers

_PAGE: dict[str, Any] = {"description": "a page that says so", "content": {"text/html": {}}}
LINK_S = 90 * 24 * 3600
"""How long a browser remembers a customer's link that was opened in it."""


def add_access_routes(app: FastAPI, access: Access, known: Callable[[str], Awaitable[None]]) -> None:
    """`/`, `/login`, `/c/...`, `/v1/session` and links. `known` raises NotFound for a delivery that there is not."""

    @app.get(f"{ASSETS}{{file}}", tags=["viewer"], response_class=Response, responses=error_answers(NotFound))
    async def get_asset(file: str, request: Request) -> Response:
        """A script, a style or an icon of the pages. Nothing of a delivery is in them, so that everybody may have
        them."""
        return asset(file, request.headers.get("if-none-match"))

    @app.get("/", tags=["viewer"], response_class=HTMLResponse)
    async def viewer(request: Request) -> Response:
        """The viewer: nothing from elsewhere. Whoever is not known yet is sent to `/login`."""
        if access_of(request.scope) == "missing_token":
            return RedirectResponse("/login", 303)
        return page("viewer")

    @app.get("/login", tags=["viewer"], response_class=HTMLResponse)
    async def login() -> Response:
        """Asks for a token."""
        return page("login")

    @app.get("/v1/session", tags=["access"])
    async def get_session(request: Request) -> Session:
        """As whom the caller is known."""
        return Session(role=_role(access, request), asked=access.asked)

    @app.post("/v1/session", tags=["access"], responses=error_answers(Unauthorised))
    async def log_in(question: SessionQuestion, request: Request, response: Response) -> Session:
        """A session for a browser; its cookie is good for as long as `SESSION_HOURS` says, and for the token's life."""
        role: Role | None = "operator" if not access.asked else None
        role = role or access.role_of_token(question.token.get_secret_value())
        if role is None:
            raise Unauthorised("this is none of the tokens that the orchestrator was started with")
        if access.asked:
            _set(response, request, SESSION_COOKIE, access.session(role), "/", access.session_s)
        return Session(role=role, asked=access.asked)

    @app.delete("/v1/session", tags=["access"], status_code=204)
    async def log_out(response: Response) -> None:
        """Takes the session's cookie back."""
        response.delete_cookie(SESSION_COOKIE, path="/", httponly=True, samesite="strict")

    @app.post("/v1/deliveries/{delivery_id}/link", tags=["access"], responses=error_answers(NotFound))
    async def make_link(delivery_id: str) -> CustomerLink:
        """The link for the delivery's customer: the same one each time."""
        await known(delivery_id)
        return CustomerLink(path=CUSTOMERS_PAGES + access.link(delivery_id))

    @app.get("/c/{link}", tags=["viewer"], response_class=HTMLResponse, responses={404: _PAGE})
    async def customers_page(link: str, request: Request) -> Response:
        """One delivery, for its customer."""
        delivery_id = access.delivery_of(link)
        if delivery_id is None:
            return page("no-such-link", 404)
        answer = page("customer")
        _set(answer, request, CUSTOMER_COOKIE, link, f"/v1/deliveries/{delivery_id}", LINK_S)
        return answer


def _role(access: Access, request: Request) -> Role:
    if not access.asked:
        return "operator"
    token = bearer_token(request.scope)
    known = access.role_of_token(token) if token is not None else None
    known = known or access.role_of_session(request.cookies.get(SESSION_COOKIE, ""))
    if known is None:
        raise Unauthorised("log in at /login, or send a token")
    return known


def _set(response: Response, request: Request, name: str, value: str, path: str, max_age_s: int) -> None:
    """A cookie that no script reads and no foreign page's request carries; over TLS, also where a proxy ends it, it is
    sent over TLS only."""
    secure = "https" in (request.url.scheme, request.headers.get("x-forwarded-proto"))
    response.set_cookie(name, value, max_age=max_age_s, path=path, secure=secure, httponly=True, samesite="strict")
