"""Before anything is flown: are there the models that a mission names?"""

from contracts.vlm_gateway import PreflightQuestion
from mission.ports import ServiceRefused, UnknownModel, Vision

READER = "reader"
"""The parser that needs no model of the gateway."""


class WrongModel(Exception):
    """No mission can be flown with this model; the message says what would be right, `code` is for programs."""

    def __init__(self, message: str, code: str) -> None:
        super().__init__(message)
        self.code = code


async def check_models(vision: Vision, seeing: str | None, parsing: str | None, *, roles: bool = False) -> None:
    """`seeing` answers about pictures, `parsing` reads the request; null where the services' own choice is wanted, of
    which a mission makes sure itself. `roles`: where no model sees by name, those of the gateway's roles are looked at
    as well. Raises WrongModel; PortError where the gateway does not say."""
    if seeing is not None or roles:
        await _check_vision(vision, seeing)
    if parsing not in (None, READER):
        await _check_parser(vision, str(parsing))


async def _check_vision(vision: Vision, name: str | None) -> None:
    try:
        await vision.preflight(PreflightQuestion(model=name))
    except UnknownModel as error:
        raise WrongModel(str(error), "unknown_model") from None
    except ServiceRefused as error:
        if error.status == 422:
            raise WrongModel(str(error), error.code) from None
        raise


async def _check_parser(vision: Vision, name: str) -> None:
    """The gateway is asked as about pictures; a model that takes none reads all the same."""
    right = f"a parser is {READER!r}, or a chat model of the gateway's configuration"
    try:
        found = await vision.preflight(PreflightQuestion(model=name))
    except UnknownModel as error:
        raise WrongModel(f"parser: {error}; {right}", "unknown_model") from None
    except ServiceRefused as error:
        if error.status == 422:
            return
        raise
    if found.backend != "chat":
        raise WrongModel(f"parser: {name!r} answers about pictures and reads no requests; {right}", "unknown_model")
