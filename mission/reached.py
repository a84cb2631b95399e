"""What came of a call to a service, in the mission's words."""

from collections.abc import Awaitable
from typing import TypeVar

from mission.ports import (
    ModelRejected,
    ModelUnreachable,
    ServiceRefused,
    ServiceUnreachable,
    ServiceUnusable,
    UnknownModel,
)
from service_kit.client import Garbled, Refused, Unreachable
from service_kit.connections import TOKEN_VARIABLES

T = TypeVar("T")

MODEL_AWAY = frozenset({"model_unreachable", "model_timeout", "model_overloaded"})
"""The error codes by which a service says that it is well but its model did not answer."""
MODEL_REJECTS = frozenset({"model_rejected", "not_recorded"})
"""Those by which it says that its model won't, however often it is asked."""


async def reached(call: Awaitable[T]) -> T:
    """The answer, or the client's error as the mission knows it."""
    try:
        return await call
    except Unreachable as error:
        raise ServiceUnreachable(str(error)) from None
    except Garbled as error:
        raise ServiceUnusable(f"{error}; is that our service, and of this version?") from None
    except Refused as error:
        if error.code == "unknown_model":
            raise UnknownModel(f"{error.service}: {error.reason}") from None
        if error.code in MODEL_AWAY | MODEL_REJECTS:
            kind = ModelUnreachable if error.code in MODEL_AWAY else ModelRejected
            raise kind(f"{error.service}: {error.reason} ({error.code})") from None
        if error.status in (401, 403):
            variable = TOKEN_VARIABLES.get(error.service)
            right = f"set {variable} or {variable}_FILE to" if variable else "give its client"
            why = f": {error.reason}" if error.status == 403 else ""
            message = f"{error.service} refuses our token ({error.status}{why}); {right} one that it accepts"
            raise ServiceUnusable(message) from None
        if error.status == 429 or error.status >= 500:
            raise ServiceUnreachable(str(error)) from None
        raise ServiceRefused(str(error), code=error.code, status=error.status) from None
