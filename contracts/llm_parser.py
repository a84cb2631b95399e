"""llm_parser: POST /v1/parse."""

from typing import Literal

from pydantic import Field

from contracts.base import Name, Wire


class ParseQuestion(Wire):
    """`model` names an alias of the service's configuration; without it the service's default is used."""

    request: str = Field(min_length=1, max_length=4000)
    model: Name | None = None


class Evidence(Wire):
    """The words of the request that the answer rests on; null where nothing was found."""

    floor: str | None = None
    object: str | None = None


class ParseAnswer(Wire):
    """`floor` counts from 1 at the ground; `object` is a lower-case noun phrase without an article, such as "green
    flower pot". What could not be found is null and named in `missing`: nothing is guessed. `outcome` is `unreadable`
    when a language model answered and its answer could not be read, `refused` when it declined."""

    outcome: Literal["answered", "unreadable", "refused"] = "answered"
    floor: int | None = Field(default=None, ge=1, le=200)
    object: str | None = Field(default=None, max_length=200)
    missing: tuple[Literal["floor", "object"], ...] = ()
    evidence: Evidence = Evidence()
    model: str
