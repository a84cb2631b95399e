"""Why a request brought no answer of a model.

ServiceError
  ModelError              `kind` is the class's own code: what is counted, and what programs tell apart
    ModelUnreachable  503  nobody answered, or what answered was no model (a proxy's page, half a reply, a crash)
    ModelTimeout      504  no answer within the deadline
    ModelOverloaded   503  the queue in front of the model is full, or the server says so; with Retry-After
      ModelRateLimited  429  the server's account is over its rate; with Retry-After and the server's x-ratelimit-*
    ModelRejected     4xx  the server refuses this request, with its own status and code; asking again won't help
      ModelNotFound     404  the server has no model of the configured name
      ModelMisconfigured  502  the server refuses the gateway: its key, its account, its address
  NotRecorded         404  replay mode, and this question was never answered before
  CacheUnavailable    503  replay mode, and the recording can't be read
  ScriptEnded         409  a scripted model has no answers left

None of them carries a key, a header or an address with credentials.
"""

import math
from collections.abc import Mapping
from http import HTTPStatus
from typing import Any, ClassVar, Literal

from service_kit.errors import BadQuestion, ServiceError, error_answers

FallbackReason = Literal[
    "unreachable", "timeout", "overloaded", "rate_limited", "server_key", "not_found", "context_length", "rejected"
]
"""Why another model may be asked: what a model's `fallback_after` lists."""
MAX_WAIT_S = 86_400.0
CONTEXT_LENGTH = "context_length_exceeded"


class ModelError(ServiceError):
    """`code` may be the server's own; `kind` is always one of ours."""

    kind: ClassVar[str]

    @property
    def fallback_reason(self) -> FallbackReason:
        """Of the kinds of failure after which another model may be asked, the one that this is."""
        return "unreachable"


class ModelUnreachable(ModelError):
    status = 503
    kind = code = "model_unreachable"


class ModelTimeout(ModelError):
    status = 504
    kind = code = "model_timeout"

    @property
    def fallback_reason(self) -> FallbackReason:
        return "timeout"


class ModelOverloaded(ModelError):
    """`retry_after_s` is told to the caller in whole seconds, at least 1."""

    status = 503
    kind = code = "model_overloaded"

    def __init__(
        self,
        message: str,
        *,
        retry_after_s: float = 1.0,
        code: str | None = None,
        details: dict[str, Any] | None = None,
        headers: Mapping[str, str] | None = None,
    ) -> None:
        seconds = max(1, math.ceil(min(retry_after_s, MAX_WAIT_S)))
        super().__init__(message, code=code, details=details, headers={**(headers or {}), "Retry-After": str(seconds)})

    @property
    def fallback_reason(self) -> FallbackReason:
        return "overloaded"


class ModelRateLimited(ModelOverloaded):
    status = 429
    code = "rate_limit_exceeded"

    @property
    def fallback_reason(self) -> FallbackReason:
        return "rate_limited"


class ModelRejected(ModelError):
    status = 400
    kind = code = "model_rejected"

    @property
    def fallback_reason(self) -> FallbackReason:
        return "context_length" if self.code == CONTEXT_LENGTH else "rejected"


class ModelNotFound(ModelRejected):
    status = 404
    code = "model_not_found"

    @property
    def fallback_reason(self) -> FallbackReason:
        return "not_found"


class ModelMisconfigured(ModelRejected):
    """`details.reason` is `server_key`, `server_account` or `server_address`."""

    status = 502

    @property
    def fallback_reason(self) -> FallbackReason:
        return "server_key"


class NotRecorded(ServiceError):
    status = 404
    code = "not_recorded"


class CacheUnavailable(ServiceError):
    status = 503
    code = "cache_unavailable"


class ScriptEnded(ServiceError):
    status = 409
    code = "script_ended"


def invalid(where: str, problem: str) -> BadQuestion:
    """What is wrong with the field at `where`."""
    return BadQuestion(
        f"{where}: {problem}", code="invalid", details={"problems": [{"field": where, "problem": problem}]}
    )


def kind_of(error: ServiceError) -> str:
    """What an error is counted as: never a server's own word, of which there are arbitrarily many."""
    return error.kind if isinstance(error, ModelError) else error.code


def of_our_question(error: ModelError) -> ModelError:
    """The error as the caller of a typed question is told it: the request that the server refused, and the account
    whose rate it was over, were the gateway's and not the caller's."""
    wait = error.headers.get("Retry-After", "1")
    if isinstance(error, ModelRejected):
        return ModelMisconfigured(error.message, details=error.details)
    if isinstance(error, ModelRateLimited):
        return ModelOverloaded(error.message, retry_after_s=float(wait), details=error.details)
    return error


ERROR_ANSWERS = error_answers(
    HTTPStatus.NOT_FOUND,
    HTTPStatus.CONFLICT,
    HTTPStatus.TOO_MANY_REQUESTS,
    HTTPStatus.BAD_GATEWAY,
    HTTPStatus.GATEWAY_TIMEOUT,
)
"""What the routes may answer with, besides what every service's may."""
