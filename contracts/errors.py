"""What every service answers when it can't do what was asked."""

from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from contracts.base import RGB, Wire
from contracts.near import did_you_mean, fields_beside

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


def what_is_wrong(problem: ErrorDetails, message: str | None = None) -> str:
    """A validation problem's sentence, as we say it. `message`: the class name of what was read, by which a field that
    there is not is told with the one that was most likely meant."""
    if problem["type"] == "extra_forbidden":
        place = problem["loc"]
        near = did_you_mean(str(place[-1]), fields_beside(message, place)) if message and place else ""
        return f"there is no such field{near}"
    if problem["type"] == "string_pattern_mismatch" and problem.get("ctx", {}).get("pattern") == RGB:
        return f"write the colour as #rrggbb in lower case, such as #c03a2b, not {problem['input']!r:.60}"
    return without_prefix(str(problem["msg"]))


def first_problem(error: ValidationError) -> str:
    """Where the first wrong value stands, and what is wrong with it."""
    first = error.errors()[0]
    where = ".".join(str(part) for part in first["loc"])
    problem = what_is_wrong(first, error.title)
    return f"{where}: {problem}" if where else problem
