"""The errors a service answers with, and the one place that renders them.

ServiceError            an answer of ours: code, status, message, details
  BadQuestion     422   the question is well-formed JSON but can't be answered as it stands
  NotFound        404   no such thing
  Conflict        409   it contradicts what happened before
  TooMany         429   a bound on live things is reached
  Unavailable     503   something that this service needs doesn't answer
"""

import logging
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
    status = 422
    code = "bad_question"


class NotFound(ServiceError):
    status = 404
    code = "not_found"


class Conflict(ServiceError):
    status = 409
    code = "conflict"


class TooMany(ServiceError):
    status = 429
    code = "too_many"


class Unavailable(ServiceError):
    status = 503
    code = "unavailable"


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
