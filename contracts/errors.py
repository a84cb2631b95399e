"""What every service answers when it can't do what was asked."""

from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from contracts.base import Wire

STOPPING = "stopping"
"""The code of a 503 that a service answers when it ends before its answer is there: ask again."""


class ErrorDetail(Wire):
    """`code` is for programs, `message` for people (what was wrong, what would have been right)."""

    code: str
    message: str
    details: dict[str, Any] = {}


class ErrorBody(Wire):
    error: ErrorDetail


def without_prefix(sentence: str) -> str:
    """A sentence of ours, without the "Value error, " that the library puts before it."""
    return sentence.removeprefix("Value error, ")


def what_is_wrong(problem: ErrorDetails) -> str:
    """A validation problem's sentence, as we say it."""
    if problem["type"] == "extra_forbidden":
        return "there is no such field"
    return without_prefix(str(problem["msg"]))


def first_problem(error: ValidationError) -> str:
    """Where the first wrong value stands, and what is wrong with it."""
    first = error.errors()[0]
    where = ".".join(str(part) for part in first["loc"])
    problem = what_is_wrong(first)
    return f"{where}: {problem}" if where else problem
