"""What every service answers when it can't do what was asked."""

from typing import Any

from pydantic_core import ErrorDetails

from contracts.base import Wire


class ErrorDetail(Wire):
    """`code` is for programs, `message` for people (what was wrong, what would have been right)."""

    code: str
    message: str
    details: dict[str, Any] = {}


class ErrorBody(Wire):
    error: ErrorDetail


def what_is_wrong(problem: ErrorDetails) -> str:
    """A validation problem's sentence, without the "Value error, " that the library puts before one of ours."""
    return str(problem["msg"]).removeprefix("Value error, ")
