"""Files of labelled requests: JSON lines, one request each."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from pydantic import ConfigDict, Field, ValidationError

from contracts.base import Wire
from contracts.errors import first_problem


class BadRequests(ValueError):
    """A file that can't be read as labelled requests; the message says where and why."""


class LabelledRequest(Wire):
    """A request and what must be read from it. `floor` counts from 1 at the ground; floor and object are null where the
    request does not say them, or must not be guessed. `object_text`: the words that the object is read from; `also_ok`:
    answers as right as `object`. Further fields are for others to use."""

    model_config = ConfigDict(extra="ignore")

    text: str = Field(min_length=1, max_length=4000)
    floor: int | None = Field(ge=1, le=200)
    object: str | None
    object_text: tuple[str, ...] = ()
    also_ok: tuple[str, ...] = ()
    tags: tuple[str, ...] = ()


class FiledRequest(NamedTuple):
    """A request and where it stands; `line` counts from 1."""

    file: str
    line: int
    request: LabelledRequest


def read_requests(files: Sequence[Path]) -> list[FiledRequest]:
    """All requests of the files, in their order; blank lines are passed over. Raises BadRequests."""
    requests = [request for file in files for request in _of_file(file)]
    named = {request.file for request in requests}
    for file in files:
        if str(file) not in named:
            raise BadRequests(f"{file} holds no requests")
    return requests


def _of_file(file: Path) -> list[FiledRequest]:
    try:
        lines = file.read_text(encoding="utf-8").split("\n")
    except OSError as error:
        raise BadRequests(f"{file}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise BadRequests(f"{file} is not a text file") from None
    return [FiledRequest(str(file), n, _one(file, n, line)) for n, line in enumerate(lines, 1) if line.strip()]


def _one(file: Path, number: int, line: str) -> LabelledRequest:
    try:
        return LabelledRequest.model_validate_json(line)
    except ValidationError as error:
        raise BadRequests(f"{file}, line {number}: {first_problem(error)}") from None
