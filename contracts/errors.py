"""What every service answers when it can't do what was asked."""

from typing import Any

from contracts.base import Wire


class ErrorDetail(Wire):
    """`code` is for programs, `message` for people (what was wrong, what would have been right)."""

    code: str
    message: str
    details: dict[str, Any] = {}


class ErrorBody(Wire):
    error: ErrorDetail
