"""Settings that name a TOML file, read at the start."""

import tomllib
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, ValidationError

from contracts.errors import first_problem
from service_kit.settings import BadSetting

T = TypeVar("T", bound=BaseModel)


class BadFile(ValueError):
    """What is wrong with a file, in one line, without its name."""


def read_toml(variable: str, path: Path, wanted: type[T]) -> T:
    """What the file that `variable` names holds. Raises BadSetting with one line that says what is wrong."""
    try:
        return toml_of(path, wanted)
    except BadFile as error:
        raise BadSetting(f"{variable}={path}: {error}") from None


def toml_of(path: Path, wanted: type[T]) -> T:
    """What a TOML file holds. Raises BadFile."""
    try:
        return wanted.model_validate(tomllib.loads(path.read_text(encoding="utf-8-sig")))
    except OSError as error:
        raise BadFile(f"{error.strerror}; name a readable file") from None
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise BadFile(f"not TOML: {error}") from None
    except ValidationError as error:
        raise BadFile(first_problem(error)) from None
    except RecursionError:
        raise BadFile("not TOML that can be read: brackets within brackets too deep") from None
    except ValueError as error:  # an integer of more digits than Python reads
        raise BadFile(f"not TOML that can be read: {error}") from None
