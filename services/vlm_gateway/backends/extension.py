"""Back ends of other packages: a table of the gateway's configuration whose `backend` an installed package brings.

The entry point (group `logisticsvln.vision_backends`) names a `BackendBuilder`. It is imported when the model is first
asked, in a thread: what is heavy belongs into it, or below.
"""

from collections.abc import Mapping
from importlib.metadata import EntryPoint
from typing import NamedTuple, Protocol

from pydantic import Field, JsonValue, field_validator

from contracts.base import Name, Wire
from service_kit.extensions import VISION_BACKENDS, BadExtension, extensions, loaded
from service_kit.settings import BadSetting
from services.vlm_gateway.backends.base import Backend

BUILT_IN = ("embedded", "scripted", "oracle", "chat")


class ExtensionModelConfig(Wire):
    """`options` are the back end's own; `timeout_s`, `concurrency` and `queue` are told to it as well."""

    backend: Name
    options: dict[str, JsonValue] = {}
    timeout_s: float = Field(default=60.0, ge=0.05, le=3600.0)
    concurrency: int = Field(default=4, ge=1, le=1024)
    queue: int = Field(default=64, ge=0, le=100_000)

    @field_validator("backend")
    @classmethod
    def _installed(cls, backend: str) -> str:
        there = extension_backends()
        if backend not in there:
            raise ValueError(f"backend must be one of {', '.join((*BUILT_IN, *there))}, not {backend!r}")
        return backend


class ExtensionModel(NamedTuple):
    """What a builder is told: the model's alias, its own options, and the limits that it is to keep."""

    alias: str
    options: Mapping[str, JsonValue]
    timeout_s: float
    concurrency: int
    queue: int


class BackendBuilder(Protocol):
    def __call__(self, model: ExtensionModel) -> Backend:
        """Raises BadSetting for options that it can't use."""


def extension_backends() -> dict[str, EntryPoint]:
    """By name, nothing imported. Raises BadExtension."""
    return extensions(VISION_BACKENDS, reserved=BUILT_IN)


def build_extension(alias: str, config: ExtensionModelConfig) -> Backend:
    """Raises BadSetting where the package can't be imported, or builds nothing that answers."""
    point = extension_backends()[config.backend]
    build = loaded(point)
    if not callable(build):
        raise BadExtension(f"{point.value} is no function that builds a back end")
    model = ExtensionModel(alias, config.options, config.timeout_s, config.concurrency, config.queue)
    try:
        backend = build(model)
    except BadSetting:
        raise
    except Exception as error:  # a stranger's code
        raise BadExtension(f"{point.value} failed: {type(error).__name__}: {error}") from error
    missing = [name for name in _PARTS if not hasattr(backend, name)]
    if missing:
        raise BadExtension(f"what {point.value} built is no back end: it has no {', '.join(missing)}")
    return backend  # type: ignore[no-any-return]


_PARTS = (
    *("kind", "model", "cacheable", "fingerprint", "preflight", "status", "close"),
    *("count_floors", "find_building", "find_object", "choose_direction"),
)
