"""The errors a service answers with, and the one place that renders them.

ServiceError            an answer of ours: code, status, message, details
  BadQuestion     422   the question is well-formed JSON but can't be answered as it stands
  Unauthorised    401   no token, or one that is not accepted
  Forbidden       403   the token, session or link does not allow this
  NotFound        404   no such thing
  Conflict        409   it contradicts what happened before
  TooMany         429   a bound on live things is reached
  Unavailable     503   something that this service needs doesn't answer
"""

import logging
from http import HTTPStatus
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import Response
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect

from contracts.errors import ErrorBody, ErrorDetail, what_is_wrong

log = logging.getLogger("service_kit.errors")

_CODES = {400: "bad_request", 401: "unauthorised", 403: "forbidden", 404: "not_found", 405: "method_not_allowed"}


class ServiceError(Exception):
    """An error that is shown to the caller as it is: nothing in it may be a secret."""

    status = 500
    code = "internal"

    def __init__(
        self,
        message: str,
        *,
        code: str | None = None,
        status: int | None = None,
        details: dict[str, Any] | None = None,
        headers: dict[str, str] | None = None,
    ) -> None:
        super().__init__(message)
        self.message = message
        self.code = code or type(self).code
        self.status = status or type(self).status
        self.details = details or {}
        self.headers = headers or {}


class BadQuestion(ServiceError):
    """It can't be answered as it stands."""

    status = 422
    code = "bad_question"


class Unauthorised(ServiceError):
    """No token, or one that is not accepted."""

    status = 401
    code = "unauthorised"


class Forbidden(ServiceError):
    """Not allowed with this token, session or link."""

    status = 403
    code = "forbidden"


class NotFound(ServiceError):
    """There is no such thing."""

    status = 404
    code = "not_found"


class Conflict(ServiceError):
    """It contradicts what happened before."""

    status = 409
    code = "conflict"


class TooMany(ServiceError):
    """As many are there as may be."""

    status = 429
    code = "too_many"


class Unavailable(ServiceError):
    """Something that is needed doesn't answer."""

    status = 503
    code = "unavailable"


def error_answers(*kinds: type[ServiceError] | HTTPStatus) -> dict[int | str, dict[str, Any]]:
    """For a route's `responses`: the errors that it may answer with, beside those of every route."""
    return {
        int(kind) if isinstance(kind, HTTPStatus) else kind.status: _described(
            kind.phrase if isinstance(kind, HTTPStatus) else str(kind.__doc__)
        )
        for kind in kinds
    }


def usual_answers(*, guarded: bool) -> dict[int | str, dict[str, Any]]:
    """The errors that every route may answer with, before it is asked or where it fails."""
    usual = {
        400: "not HTTP, or not the encoding it says",
        408: "the body did not come in time",
        413: "the body is over the limit",
        415: "a form of body that is not read",
        421: "the server is not called by that name",
        422: "the question is not of the contract, or can't be answered as it stands",
        500: "a bug; the service's log has the details",
        503: "something that is needed does not answer, too much is under way, or the service stops",
    }
    known = {401: "no token, or one that is not accepted", 403: "not allowed with this token"} if guarded else {}
    return {status: _described(meaning) for status, meaning in (usual | known).items()}


def describe_errors_as_json(app: FastAPI) -> None:
    """The framework describes errors in the media type of the route's answer; ours are JSON wherever they come from,
    but for those that a route describes as a page, without a schema."""
    usual = app.openapi

    def openapi() -> dict[str, Any]:
        described = usual()
        for path in described["paths"].values():
            for operation in path.values():
                for status, answer in operation["responses"].items():
                    if status >= "400" and (content := next(iter(answer["content"].values()))):
                        answer["content"] = {"application/json": content}
        return described

    app.openapi = openapi  # type: ignore[method-assign]


def _described(meaning: str) -> dict[str, Any]:
    return {"model": ErrorBody, "description": meaning}


def error_response(
    status: int, code: str, message: str, details: dict[str, Any] | None = None, headers: dict[str, str] | None = None
) -> Response:
    """The one shape of every error."""
    body = ErrorBody(error=ErrorDetail(code=code, message=message, details=details or {}))
    return Response(body.model_dump_json(), status_code=status, media_type="application/json", headers=headers)


def install_error_renderer(app: FastAPI) -> None:
    """Every error of `app`, ours, the framework's or a bug, leaves in the same shape and without a traceback."""

    @app.exception_handler(ServiceError)
    async def _ours(_: Request, error: ServiceError) -> Response:
        return error_response(error.status, error.code, error.message, error.details, error.headers)

    @app.exception_handler(RequestValidationError)
    async def _invalid(_: Request, error: RequestValidationError) -> Response:
        problems = [
            {"field": ".".join(str(part) for part in e["loc"] if part != "body") or "body", "problem": what_is_wrong(e)}
            for e in error.errors()[:8]
        ]
        first = problems[0] if problems else {"field": "body", "problem": "not valid"}
        message = f"{first['field']}: {first['problem']}"
        if len(error.errors()) > 1:
            message += f" (and {len(error.errors()) - 1} more)"
        return error_response(422, "invalid", message[:500], {"problems": problems})

    @app.exception_handler(HTTPException)
    async def _framework(_: Request, error: HTTPException) -> Response:
        code = _CODES.get(error.status_code, "http_error")
        return error_response(error.status_code, code, str(error.detail), headers=dict(error.headers or {}))

    @app.exception_handler(ClientDisconnect)
    async def _left(_: Request, __: ClientDisconnect) -> Response:
        return error_response(499, "caller_left", "the caller left before its request was through")

    @app.exception_handler(Exception)
    async def _bug(request: Request, error: Exception) -> Response:
        log.error("unexpected error in %s %s", request.method, request.url.path, exc_info=error)
        return error_response(500, "internal", "an unexpected error; the service's log has the details")
