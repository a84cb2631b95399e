"""Why a question brought no answer of a model.

ServiceError
  ModelUnreachable  503  nobody answered, or what answered was no model (a proxy's page, half a reply, a crash)
  ModelTimeout      504  no answer within the deadline
  ModelOverloaded   503  the queue in front of the model is full, or the server says so; with Retry-After
  ModelRejected     502  the server refuses our request: key, model name, size; asking again won't help
  NotRecorded       404  replay mode, and this question was never answered before
  CacheUnavailable  503  replay mode, and the recording can't be read
  ScriptEnded       409  a scripted model has no answers left

None of them carries a key, a header or an address with credentials.
"""

import math

from service_kit.errors import ServiceError


class ModelUnreachable(ServiceError):
    status = 503
    code = "model_unreachable"


class ModelTimeout(ServiceError):
    status = 504
    code = "model_timeout"


class ModelOverloaded(ServiceError):
    """`retry_after_s` is told to the caller in whole seconds, at least 1."""

    status = 503
    code = "model_overloaded"

    def __init__(self, message: str, *, retry_after_s: float = 1.0, details: dict[str, object] | None = None) -> None:
        seconds = max(1, math.ceil(min(retry_after_s, 3600.0)))
        super().__init__(message, details=details, headers={"Retry-After": str(seconds)})


class ModelRejected(ServiceError):
    status = 502
    code = "model_rejected"


class NotRecorded(ServiceError):
    status = 404
    code = "not_recorded"


class CacheUnavailable(ServiceError):
    status = 503
    code = "cache_unavailable"


class ScriptEnded(ServiceError):
    status = 409
    code = "script_ended"
