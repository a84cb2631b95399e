"""The port that every back end of this service implements."""

from typing import Protocol

from contracts.llm_parser import ParseAnswer, ParseQuestion


class Parser(Protocol):
    """Reads a request. `problem` is null while the parser can answer, else what is wrong."""

    async def parse(self, question: ParseQuestion) -> ParseAnswer:
        """The answer, with `missing` for what the request does not say surely. Raises ServiceError where none can be
        had."""
        ...

    async def problem(self) -> str | None: ...
