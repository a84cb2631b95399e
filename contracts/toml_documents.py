"""Documents in TOML that ship in a folder of this package, or that somebody keeps in a file of their own: rigs, sensor
profiles. Whatever a file holds, one line says what is wrong with it.
"""

import tomllib
from collections.abc import Callable
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from pydantic import ValidationError

from contracts.errors import first_problem

T = TypeVar("T")
MAX_BYTES = 64 * 1024


class Kind(NamedTuple):
    """`folder` below `package`; `noun` and `plural` are what people call such a document; `error` is raised for one
    that is none."""

    folder: str
    noun: str
    plural: str
    error: type[ValueError]
    package: str = "contracts"

    def names(self) -> tuple[str, ...]:
        """Those that ship with the project."""
        folder = resources.files(self.package) / self.folder
        return tuple(sorted(f.name.removesuffix(".toml") for f in folder.iterdir() if f.name.endswith(".toml")))

    def shipped(self, name: str, read: Callable[[dict[str, Any]], T]) -> T:
        """The shipped document of that name. Raises `error`."""
        if name not in self.names():
            raise self.error(f"there is no {self.noun} {name!r}; there are {', '.join(self.names())}")
        text = (resources.files(self.package) / self.folder / f"{name}.toml").read_text(encoding="utf-8")
        return self.parse(text, name, read)

    def load(self, name_or_file: str, read: Callable[[dict[str, Any]], T]) -> T:
        """A shipped one by its name, or one from a file. Raises `error`."""
        if name_or_file in self.names():
            return self.shipped(name_or_file, read)
        path = Path(name_or_file)
        try:
            if not path.is_file():
                known = ", ".join(self.names())
                raise self.error(f"{name_or_file!r} is neither a file nor one of the shipped {self.plural}: {known}")
            if path.stat().st_size > MAX_BYTES:
                raise self.error(f"{path} is larger than {MAX_BYTES} bytes: that is no {self.noun}")
            return self.parse(path.read_text(encoding="utf-8"), str(path), read)
        except (OSError, UnicodeDecodeError) as error:
            raise self.error(f"{path} can't be read: {_why(error)}") from None

    def parse(self, text: str, source: str, read: Callable[[dict[str, Any]], T]) -> T:
        """`read` makes the document of the file's tables. `source` is named in errors. Raises `error`."""
        try:
            return read(tomllib.loads(text))
        except tomllib.TOMLDecodeError as error:
            raise self.error(f"{source} is not TOML: {error}") from None
        except RecursionError:
            raise self.error(f"{source} is not a {self.noun}: it is nested too deeply") from None
        except ValidationError as error:
            raise self.error(f"{source} is not a {self.noun}: {first_problem(error)}") from None
        except ValueError as error:
            raise self.error(f"{source} is not a {self.noun}: {error}") from None


def _why(error: OSError | UnicodeDecodeError) -> str:
    if isinstance(error, UnicodeDecodeError):
        return "it is not a text in UTF-8"
    return error.strerror or type(error).__name__
