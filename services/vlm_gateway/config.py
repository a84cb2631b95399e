"""The gateway's TOML file: which models there are and which of them plays which role.

```toml
[models.qwen]                       # an alias of your choice
backend = "chat"                    # chat | embedded | oracle | scripted | what a package brings (docs/extending.md)
preset = "qwen2.5-vl"               # how the model wants to be asked: presets/families.toml
server = "vllm"                     # what the server understands: presets/servers.toml
base_url = "http://127.0.0.1:8000/v1"
model = "Qwen/Qwen2.5-VL-7B-Instruct"

[roles]
floors = "qwen"                     # parser | floors | recognition | choice
```
"""

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from pydantic import Field, ValidationError

from contracts.base import ModelName, Name, Wire
from contracts.errors import what_is_wrong
from contracts.near import did_you_mean
from contracts.vlm_gateway import Role
from service_kit.settings import BadSetting, secret
from services.vlm_gateway.backends.extension import BUILT_IN, ExtensionModelConfig, extension_backends
from services.vlm_gateway.model_configs import (
    NO_NOISE,
    ChatModelConfig,
    EmbeddedModelConfig,
    ModelConfig,
    OracleModelConfig,
    OracleNoise,
    ScriptedModelConfig,
    ServerConfig,
)
from services.vlm_gateway.presets import BoxOrder, BoxStyle, Family, Server, Structured, families, servers
from services.vlm_gateway.usage.budgets import BudgetConfig

ROLES: tuple[Role, ...] = ("parser", "floors", "recognition", "choice")


class KeyConfig(BudgetConfig):
    """One caller's key and what it may do; what is not given is not bounded. Only the key's SHA-256 is kept
    (`python -m services.vlm_gateway.keys` makes both). Callers of one `tenant` (by default each key is its own) share
    cached answers, those of one `team` its budgets. Budgets by day and month (UTC) are shared by all workers and
    replicas, those by minute count per process. `admin` may read /metrics, /v1/status and everybody's usage."""

    sha256: str = Field(pattern=r"^[0-9a-f]{64}$")
    tenant: Name | None = None
    team: Name | None = None
    models: tuple[ModelName, ...] | None = None
    requests_per_minute: int | None = Field(default=None, ge=1, le=10_000_000)
    concurrency: int | None = Field(default=None, ge=1, le=100_000)
    tokens_per_minute: int | None = Field(default=None, ge=1, le=10_000_000_000)
    admin: bool = False


class ChatLimits(Wire):
    """Bounds of one chat request: its messages, pictures (frames), answer's tokens, and of a picture as it comes in
    its sides and area in pixels; of every route, the body's bytes."""

    messages: int = Field(default=2000, ge=1, le=1_000_000)
    pictures: int = Field(default=64, ge=0, le=1000)
    tokens: int = Field(default=262_144, ge=1, le=100_000_000)
    picture_side: int = Field(default=16_384, ge=16, le=65_535)
    picture_pixels: int = Field(default=64_000_000, ge=256, le=1_000_000_000)
    body_bytes: int = Field(default=24 * 1024 * 1024, ge=1024, le=1024 * 1024 * 1024)


NO_LIMITS_SET = ChatLimits()


class _File(Wire):
    models: dict[ModelName, ModelConfig] = {}
    roles: dict[Role, ModelName] = {}
    keys: dict[Name, KeyConfig] = {}
    limits: ChatLimits = NO_LIMITS_SET
    teams: dict[Name, BudgetConfig] = {}


class GatewayConfig(Wire):
    """`roles` holds an alias of `models` for every role that has one; `parser` has none unless it is given. Without
    `keys` everybody may ask everything."""

    models: dict[ModelName, ModelConfig]
    roles: dict[Role, ModelName]
    keys: dict[Name, KeyConfig] = {}
    limits: ChatLimits = NO_LIMITS_SET
    teams: dict[Name, BudgetConfig] = {}


class ChatModel(Wire):
    """A chat model with its preset, its server and its own settings put together."""

    alias: ModelName
    config: ChatModelConfig
    family: Family
    server: Server
    base_url: str
    servers: tuple[ServerConfig, ...]

    @property
    def structured(self) -> Structured:
        return self.config.structured or self.server.structured

    @property
    def counts_streams(self) -> bool:
        return self.server.counts_streams if self.config.counts_streams is None else self.config.counts_streams

    @property
    def temperature(self) -> float:
        return self.family.temperature if self.config.temperature is None else self.config.temperature

    @property
    def max_tokens(self) -> int:
        return self.config.max_tokens or self.family.max_tokens

    @property
    def max_images(self) -> int:
        return self.config.max_images or self.family.max_images

    @property
    def boxes(self) -> BoxStyle:
        return self.config.boxes or self.family.boxes

    @property
    def box_order(self) -> BoxOrder:
        return self.config.box_order or self.family.box_order

    @property
    def image_factor(self) -> int:
        return self.config.image_factor or self.family.image_factor

    @property
    def pixel_range(self) -> tuple[int, int]:
        return self.config.min_pixels or self.family.min_pixels, self.config.max_pixels or self.family.max_pixels


def load_config(path: Path | None, *, oracle_allowed: bool, noise: OracleNoise = NO_NOISE) -> GatewayConfig:
    """The file's models and roles on top of the defaults: `embedded` for every vision role, and `oracle` as a further
    alias where it is allowed, as noisy as `noise` says, and each back end of an installed package under its own name.
    Raises BadSetting naming file and key."""
    file = _File() if path is None else _read(path)
    where = str(path)
    models: dict[str, ModelConfig] = {"embedded": EmbeddedModelConfig(backend="embedded")}
    if oracle_allowed:
        models["oracle"] = OracleModelConfig(backend="oracle", noise=noise)
    models.update({name: ExtensionModelConfig(backend=name) for name in extension_backends()})
    models.update(file.models)
    for alias, model in models.items():
        if isinstance(model, OracleModelConfig) and not oracle_allowed:
            raise BadSetting(
                f"{where}: models.{alias}: backend 'oracle' asks the simulator for the truth; set ORACLE_SIM_URL to "
                "switch it on, or take this model out"
            )
        if isinstance(model, ChatModelConfig):
            chat_model(alias, model, where)
    roles: dict[Role, str] = {"floors": "embedded", "recognition": "embedded", "choice": "embedded"}
    for role, alias in file.roles.items():
        if alias not in models:
            raise BadSetting(f"{where}: roles.{role}: no model {alias!r}; there are {', '.join(sorted(models))}")
        if role == "parser" and not isinstance(models[alias], ChatModelConfig):
            raise BadSetting(f"{where}: roles.parser: {alias!r} is no language model; name one with backend 'chat'")
        roles[role] = alias
    _check_names(file, models, where)
    return GatewayConfig(models=models, roles=roles, keys=file.keys, teams=file.teams, limits=file.limits)


def _check_names(file: _File, models: Mapping[str, ModelConfig], where: str) -> None:
    """That fallbacks and keys name models there are, and no two keys are one."""
    for alias, model in models.items():
        for at, other in enumerate(model.fallbacks if isinstance(model, ChatModelConfig) else ()):
            if other == alias or not isinstance(models.get(other), ChatModelConfig):
                raise BadSetting(f"{where}: models.{alias}.fallbacks.{at}: {other!r} is no other chat model")
    names: dict[str, str] = {}
    for name, key in file.keys.items():
        if key.team is not None and key.team not in file.teams:
            there = ", ".join(sorted(file.teams)) or "none"
            raise BadSetting(f"{where}: keys.{name}.team: no team {key.team!r} under [teams]; there are {there}")
        if (first := names.setdefault(key.sha256, name)) != name:
            raise BadSetting(f"{where}: keys.{name}.sha256: the same key as keys.{first}")
        for other in key.models or ():
            if other not in models:
                raise BadSetting(
                    f"{where}: keys.{name}.models: no model {other!r}; there are {', '.join(sorted(models))}"
                )


def chat_model(alias: str, config: ChatModelConfig, where: str) -> ChatModel:
    """Raises BadSetting where preset, server or address are wrong."""
    key = f"{where}: models.{alias}"
    family = families().get(config.preset)
    if family is None:
        raise BadSetting(f"{key}.preset: no preset {config.preset!r}; there are {', '.join(families())}")
    server = servers().get(config.server)
    if server is None:
        raise BadSetting(f"{key}.server: no server {config.server!r}; there are {', '.join(servers())}")
    if config.base_url and config.base_urls:
        raise BadSetting(f"{key}: give base_url or base_urls, not both")
    given = config.base_urls or (config.base_url or server.base_url,)
    tables = [one if isinstance(one, ServerConfig) else ServerConfig(url=one or " ") for one in given]
    where_from = "base_urls" if config.base_urls else "base_url"
    urls = tuple(one.model_copy(update={"url": _address(one.url, server, f"{key}.{where_from}")}) for one in tables)
    if not any(one.weight and not one.canary for one in urls):
        raise BadSetting(f"{key}.base_urls: every server has weight 0 or is a canary; leave at least one to be asked")
    if len({urlsplit(one.url).path for one in urls}) > 1:
        raise BadSetting(f"{key}.base_urls: give addresses with the same path")
    if config.api_key_env and config.api_key_file:
        raise BadSetting(f"{key}: give api_key_env or api_key_file, not both")
    low, high = config.min_pixels or family.min_pixels, config.max_pixels or family.max_pixels
    if low > high:
        raise BadSetting(f"{key}: min_pixels {low} is over max_pixels {high}")
    if config.context_tokens is not None and server.api != "ollama":
        raise BadSetting(f"{key}.context_tokens: only server 'ollama' takes it; set it where the server starts")
    reserved = sorted({"model", "messages", "stream", "n"} & set(config.extra))
    if reserved:
        raise BadSetting(f"{key}.extra: {', '.join(reserved)} can't be set here; the gateway sets it")
    return ChatModel(alias=alias, config=config, family=family, server=server, base_url=urls[0].url, servers=urls)


def _address(given: str, server: Server, where: str) -> str:
    """Raises BadSetting."""
    address = given.strip().rstrip("/")
    if server.api == "ollama" and not address.endswith("/v1"):
        address += "/v1"  # where chats of clients go; typed questions go to /api/chat beside it
    parts = urlsplit(address)
    if parts.scheme not in ("http", "https") or not parts.hostname:
        raise BadSetting(f"{where}: {address!r} is no address; give one such as http://127.0.0.1:8000/v1")
    if parts.username or parts.password or parts.query:
        raise BadSetting(f"{where}: leave credentials out of the address; use api_key_env or api_key_file")
    return address


def api_key(alias: str, config: ChatModelConfig, environment: Mapping[str, str], where: str) -> str | None:
    """The key out of the environment or a file. Raises BadSetting where a named key isn't there."""
    if config.api_key_env:
        value = secret(environment, config.api_key_env)
        if not value:
            raise BadSetting(f"{where}: models.{alias}.api_key_env: {config.api_key_env} is not set")
        return _fit_for_a_header(value, f"{where}: models.{alias}.api_key_env: {config.api_key_env}")
    if config.api_key_file:
        try:
            value = Path(config.api_key_file).expanduser().read_text(encoding="utf-8").strip()
        except OSError as error:
            raise BadSetting(f"{where}: models.{alias}.api_key_file: {error.strerror}: {config.api_key_file}") from None
        if not value:
            raise BadSetting(f"{where}: models.{alias}.api_key_file: {config.api_key_file} is empty")
        return _fit_for_a_header(value, f"{where}: models.{alias}.api_key_file: {config.api_key_file}")
    return None


def _fit_for_a_header(key: str, where: str) -> str:
    if not key.isascii() or not key.isprintable() or " " in key:
        raise BadSetting(f"{where} holds more than a key: spaces, line breaks or other characters no key has")
    return key


def _read(path: Path) -> _File:
    try:
        document: Mapping[str, Any] = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise BadSetting(f"GATEWAY_CONFIG={path}: {error.strerror}; name a readable TOML file") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise BadSetting(f"{path}: not valid TOML: {error}") from None
    try:
        return _File.model_validate(document)
    except ValidationError as error:
        first = error.errors()[0]
        kinds = (*BUILT_IN, "extension")
        place = [str(part) for part in first["loc"] if part != "[key]"]  # pydantic's mark of a wrong key
        if len(place) > 2 and place[0] == "models" and place[2] in kinds:
            del place[2]  # pydantic's name of the variant, which is no key of the file
        message = what_is_wrong(first)
        if first["type"] == "extra_forbidden":
            message = f"no such key; there are {', '.join(_keys_beside(document, place))}"
        elif first["type"] in ("union_tag_not_found", "union_tag_invalid"):
            message = f"backend must be one of {', '.join((*BUILT_IN, *extension_backends()))}"
        elif first["type"] == "literal_error" and place[0] == "roles":
            message = f"no such role{did_you_mean(place[-1], ROLES)}; there are {', '.join(ROLES)}"
        raise BadSetting(f"{path}: {'.'.join(place)}: {message}") from None


def _keys_beside(document: Mapping[str, Any], place: list[str]) -> list[str]:
    """The keys that are allowed where `place` is not."""
    if len(place) < 3:
        return list(_File.model_fields)
    if place[0] in ("keys", "teams"):
        return list((KeyConfig if place[0] == "keys" else BudgetConfig).model_fields)
    variants: dict[str, type[Wire]] = {
        "embedded": EmbeddedModelConfig,
        "scripted": ScriptedModelConfig,
        "oracle": OracleModelConfig,
        "chat": ChatModelConfig,
    }
    fields = variants.get(document["models"][place[1]]["backend"], ExtensionModelConfig).model_fields
    return [field.alias or name for name, field in fields.items()]
