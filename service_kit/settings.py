"""Typed settings of a process, read out of an environment that is handed in.

A service declares one `Settings` class; each field is one variable, named like the field in capitals. The class is all
there is to know about them: type, default, bounds and meaning. A field of type `Secret` or `Token` may also be given as
a file, named by `<VARIABLE>_FILE`. Which variables exist is documented in `docs/configuration.md`, written from the
classes.
"""

import difflib
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Self, get_args, get_origin
from urllib.parse import urlsplit, urlunsplit

from annotated_types import Ge, Le
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, SecretStr, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails, PydanticUndefined

NEARLY_ALIKE = 0.85
"""From this similarity (0..1, `difflib`) on an unknown variable is taken for a misspelt one."""


DRAIN_S = 25
"""Less than the 30 s that containers' platforms give between SIGTERM and SIGKILL."""


class BadSetting(Exception):
    """A setting that can't be used; the message names it and says what would have been right."""


def _http_address(value: str) -> str:
    parts = urlsplit(value)
    if parts.scheme not in ("http", "https") or not parts.hostname:
        raise ValueError("give an http:// or https:// address")
    return value.rstrip("/")


def _fit_for_a_header(value: SecretStr) -> SecretStr:
    token = value.get_secret_value()
    if not token.isascii() or not token.isprintable() or " " in token:
        raise ValueError("a token is printable ASCII without spaces or line breaks")
    return value


HttpAddress = Annotated[str, AfterValidator(_http_address)]
"""Where a service listens, without a slash at the end."""

Secret = SecretStr
"""A value that is never shown, and may lie in a file."""

Token = Annotated[SecretStr, AfterValidator(_fit_for_a_header)]
"""A secret that is sent in an HTTP header."""


class Variable(NamedTuple):
    """One environment variable, for a person: `kind` is its type with its bounds, `default` is empty where unset."""

    name: str
    kind: str
    default: str
    meaning: str
    secret: bool


class Settings(BaseModel):
    """The settings of one process. `prefixes` mark variables that can only be meant for it."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, protected_namespaces=())
    prefixes: ClassVar[tuple[str, ...]] = ()

    @classmethod
    def read(cls, environment: Mapping[str, str]) -> Self:
        """The settings in `environment`; empty counts as not set. Raises BadSetting, which names every wrong variable
        and what would be right."""
        given: dict[str, str] = {}
        for field, info in cls.model_fields.items():
            value = environment.get(field.upper()) or (secret(environment, field.upper()) if _secret(info) else None)
            if value:
                given[field] = value
        try:
            return cls.model_validate(given)
        except ValidationError as error:
            raise BadSetting("; ".join(cls._problem(one, environment) for one in error.errors())) from None

    @classmethod
    def variables(cls) -> tuple[Variable, ...]:
        """All variables, in the order of the fields."""
        return tuple(_variable(field.upper(), info) for field, info in cls.model_fields.items())

    @classmethod
    def names(cls) -> frozenset[str]:
        """The names of all variables, those of files included."""
        names = {variable.name for variable in cls.variables()}
        return frozenset(names | {f"{variable.name}_FILE" for variable in cls.variables() if variable.secret})

    @classmethod
    def unknown(cls, environment: Mapping[str, str], others: frozenset[str] = frozenset()) -> list[str]:
        """A sentence for every variable that is none, but begins like one of these, is spelt nearly alike or lacks the
        first word of one. `others` are names that belong to somebody else."""
        names = cls.names()
        said = []
        for name in sorted(environment.keys() - names - others):
            nearest = difflib.get_close_matches(name, names, 1, NEARLY_ALIKE)
            nearest = nearest or sorted(known for known in names if "_" in name and known.endswith(f"_{name}"))
            if nearest or name.startswith(cls.prefixes):
                meant = nearest or difflib.get_close_matches(name, names, 1)
                hint = f"; did you mean {meant[0]}?" if meant else ""
                said.append(f"{name} is set, but there is no such setting{hint}")
        return said

    @classmethod
    def _problem(cls, error: ErrorDetails, environment: Mapping[str, str]) -> str:
        field = str(error["loc"][0])
        name = field.upper()
        info = cls.model_fields[field]
        if error["type"] == "missing":
            return f"{name} is not set; set it" + (f" or {name}_FILE" if _secret(info) else "")
        right = str(error["ctx"]["error"]) if error["type"] == "value_error" else _right(info)
        if not _secret(info):
            return f"{name}={environment[name]}: {right}"
        # the secret itself is not shown
        return f"{name}: {right}" if environment.get(name) else f"{name}_FILE={environment[name + '_FILE']}: {right}"


class ServiceSettings(Settings):
    """What every service's process reads; a service adds its own fields, and its own default of `port`."""

    host: str = Field("127.0.0.1", description="The address to listen at; `0.0.0.0` in a container.")
    allowed_hosts: str = Field(
        "",
        description="Names by which callers may call it (the header `Host`), comma-separated, such as "
        "`drones.example,*.internal`; `*`: any. `localhost`, plain IP addresses and names without a dot always may.",
    )
    listen_without_token: bool = Field(
        False, description="Whether to listen beyond this machine though no token is set."
    )
    port: int = Field(8000, ge=1, le=65535, description="The TCP port to listen at.")
    log_level: Literal["debug", "info", "warning", "error"] = Field(
        "warning", description="The least severe log lines that are written (JSON, to standard error)."
    )
    drain_timeout_s: int = Field(
        DRAIN_S, ge=0, le=86_400, description="Seconds that requests under way have to end after SIGTERM."
    )
    max_connections: int = Field(
        0, ge=0, le=1_000_000, description="Connections of callers at a time; 0: as many as there are file descriptors."
    )
    head_timeout_s: float = Field(15.0, ge=0.1, le=3600.0, description="Seconds a request's head may take.")
    body_timeout_s: float = Field(30.0, ge=0.1, le=3600.0, description="Seconds a request's body may take after that.")
    write_timeout_s: float = Field(
        10.0, ge=0.1, le=3600.0, description="Seconds that a caller may take nothing of an answer that waits for it."
    )
    keep_alive_s: int = Field(30, ge=1, le=3600, description="Seconds that an unused connection stays open.")
    max_held_mb: int = Field(
        512, ge=1, le=1_000_000, description="MiB of request bodies held at a time, over all callers."
    )
    parent_pid: int = Field(
        0, ge=0, le=2**31 - 1, description="The process that started this one: the service ends with it. 0: none."
    )


def secret(environment: Mapping[str, str], name: str) -> str | None:
    """The variable's value, or what the file holds that `<name>_FILE` names, or null. Raises BadSetting where the file
    can't be read or is empty."""
    value, path = environment.get(name), environment.get(f"{name}_FILE")
    if value or not path:
        return value or None
    try:
        value = Path(path).expanduser().read_text(encoding="utf-8").strip()
    except OSError as error:
        raise BadSetting(f"{name}_FILE={path}: {error.strerror}; name a readable file") from None
    except UnicodeDecodeError:
        raise BadSetting(f"{name}_FILE={path}: not a text file; name one that holds the secret alone") from None
    if not value:
        raise BadSetting(f"{name}_FILE={path}: the file is empty; write the secret into it")
    return value


def process_environment() -> dict[str, str]:
    """This process's environment: the only place where it is read."""
    return dict(os.environ)


def tell_library(variable: str, value: str) -> None:
    """Sets what a library itself reads from this process's environment, unless it is set."""
    os.environ.setdefault(variable, value)


def revealed(value: SecretStr | None) -> str | None:
    """What a secret holds."""
    return None if value is None else value.get_secret_value()


def without_password(url: str) -> str:
    """The URL as it may be shown: user and password left out."""
    parts = urlsplit(url)
    host = parts.hostname or ""
    port = f":{parts.port}" if parts.port else ""
    return urlunsplit((parts.scheme, host + port, parts.path, "", ""))


def _types(annotation: Any) -> Iterator[Any]:
    """The types that an annotation is made of, unions and `Annotated` taken apart."""
    if get_origin(annotation) in (None, Literal):
        yield annotation
    else:
        for part in get_args(annotation):
            yield from _types(part)


def _secret(info: FieldInfo) -> bool:
    return SecretStr in _types(info.annotation)


def _choices(info: FieldInfo) -> tuple[str, ...]:
    return next((get_args(kind) for kind in _types(info.annotation) if get_origin(kind) is Literal), ())


def _bounds(info: FieldInfo) -> str:
    low = next((mark.ge for mark in info.metadata if isinstance(mark, Ge)), None)
    high = next((mark.le for mark in info.metadata if isinstance(mark, Le)), None)
    return "" if low is None or high is None else f" from {low:.10g} to {high:.10g}"


def _kind(info: FieldInfo) -> str:
    if choices := _choices(info):
        return " | ".join(choices)
    if info.annotation is bool:
        return "on | off"
    if info.annotation in (int, float):
        return ("whole number" if info.annotation is int else "number") + _bounds(info)
    if _secret(info):
        return "secret"
    if Path in _types(info.annotation):
        return "path"
    return "address" if any(mark.func is _http_address for mark in _validators(info)) else "text"


def _validators(info: FieldInfo) -> Iterator[AfterValidator]:
    """Of the field itself, and of a type in a union."""
    marks = [*info.metadata]
    for part in get_args(info.annotation):
        marks.extend(get_args(part)[1:] if get_origin(part) is Annotated else ())
    return (mark for mark in marks if isinstance(mark, AfterValidator))


def _right(info: FieldInfo) -> str:
    """What a value would have to be."""
    if choices := _choices(info):
        return f"choose one of {', '.join(choices)}"
    if info.annotation is bool:
        return "say on or off"
    return f"give a {_kind(info)}"


def _variable(name: str, info: FieldInfo) -> Variable:
    default = info.default
    if default is None or default is PydanticUndefined:
        shown = ""
    elif isinstance(default, bool):
        shown = "on" if default else "off"
    elif isinstance(default, float):
        shown = f"{default:.10g}"
    else:
        shown = str(default)
    return Variable(name, _kind(info), shown, info.description or "", _secret(info))
