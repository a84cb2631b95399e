"""Settings in, a wired app out. The only place that chooses the real parts."""

import hashlib
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import NamedTuple

from contracts.vlm_gateway import Role
from service_kit.metrics import HttpMetrics
from service_kit.requests import Origins
from service_kit.settings import BadSetting, revealed
from service_kit.workers import Worker
from services.vlm_gateway.app import build_app, chat_targets
from services.vlm_gateway.backends.base import Backend
from services.vlm_gateway.backends.extension import ExtensionModelConfig, build_extension
from services.vlm_gateway.backends.lazy import LazyBackend
from services.vlm_gateway.backends.scripted import ScriptedBackend, load_script
from services.vlm_gateway.cache.claims import Claims
from services.vlm_gateway.cache.factory import cache_of
from services.vlm_gateway.cache.guard import GuardedCache
from services.vlm_gateway.chat.backend import ChatBackend
from services.vlm_gateway.config import ChatLimits, api_key, chat_model, load_config
from services.vlm_gateway.gateway import Gateway
from services.vlm_gateway.hot.frontend import Frontend
from services.vlm_gateway.keys import Keys
from services.vlm_gateway.metrics import GatewayMetrics
from services.vlm_gateway.model_configs import (
    ChatModelConfig,
    EmbeddedModelConfig,
    ModelConfig,
    OracleModelConfig,
    OracleNoise,
)
from services.vlm_gateway.question_extensions import extension_questions
from services.vlm_gateway.questions import KINDS
from services.vlm_gateway.reloading import Reloader
from services.vlm_gateway.settings import GatewaySettings
from services.vlm_gateway.shared_limits import SharedPlaces
from services.vlm_gateway.tracking import NO_TRACER, Tracer
from services.vlm_gateway.upstream.client import Upstream
from services.vlm_gateway.usage.accounts import Accounts, Price
from services.vlm_gateway.usage.factory import usage_store_of
from services.vlm_gateway.usage.ledger import Ledger


class Configured(NamedTuple):
    """What the configuration file makes. `sources` are what each back end was made of: its table and its server's
    key."""

    backends: dict[str, Backend]
    sources: dict[str, tuple[ModelConfig, str | None]]
    roles: dict[Role, str]
    keys: Keys
    prices: dict[str, Price]
    limits: ChatLimits


def build(settings: GatewaySettings, worker: Worker | None = None, *, environment: Mapping[str, str]) -> Frontend:
    """`environment` holds the keys that the configuration names by their variables; `worker` says which one of several
    processes this is. Raises BadSetting, naming what is wrong and what would be right."""
    http = HttpMetrics()
    figures = GatewayMetrics(http.registry)
    now = configured(settings, environment, figures, worker)
    store = None if settings.cache_mode == "off" else cache_of(settings)
    cache = None if store is None else GuardedCache(store, settings.cache_mode, figures.cache_failed)
    accounts = Accounts(Ledger(usage_store_of(settings), figures.usage_failed), now.prices, figures)
    gateway = Gateway(now.backends, now.roles, cache, figures, accounts, (*KINDS, *extension_questions()))
    origins = Origins(origin for said in settings.cors_origins.split(",") if (origin := said.strip()))

    def reload() -> list[Backend]:
        nonlocal now
        new = configured(settings, environment, figures, worker, now)
        if settings.gateway_config is not None and not settings.gateway_config.read_text().strip():
            raise BadSetting(f"{settings.gateway_config} is empty: it may be just being written")
        if now.keys.all and not new.keys.all:
            raise BadSetting(
                f"{settings.gateway_config} has no keys left, which would let everybody in: restart for that"
            )
        gateway.adopt(new.backends, new.roles)
        accounts.adopt(new.prices)
        frontend.keys.adopt(new.keys)
        frontend.models.adopt(chat_targets(new.backends), new.roles.get("parser"))
        frontend.configured(new.limits)
        retired = [backend for alias, backend in now.backends.items() if new.backends.get(alias) is not backend]
        now = new
        return retired

    def files() -> list[Path]:
        keys = [m.api_key_file for m, _ in now.sources.values() if isinstance(m, ChatModelConfig) and m.api_key_file]
        return [path for path in (settings.gateway_config, *map(Path, keys)) if path is not None]

    frontend = build_app(
        gateway,
        http,
        keys=now.keys,
        log_share=settings.request_log_share,
        origins=origins,
        limits=now.limits,
        tracer=_tracer(settings),
        reloader=Reloader(reload, files) if settings.gateway_config is not None else None,
        worker=worker,
        claims=None if worker is None or cache is None or cache.mode != "on" else Claims(worker, cache),
    )
    return frontend


def _tracer(settings: GatewaySettings) -> Tracer:
    endpoint = settings.otel_exporter_otlp_endpoint
    if endpoint is None:
        return NO_TRACER
    try:
        from services.vlm_gateway.otel import OtelTracer
    except ImportError:
        raise BadSetting("OTEL_EXPORTER_OTLP_ENDPOINT: install the extra `otel` to send traces, or unset it") from None
    return OtelTracer(endpoint)


def configured(
    settings: GatewaySettings,
    environment: Mapping[str, str],
    figures: GatewayMetrics,
    worker: Worker | None = None,
    before: Configured | None = None,
) -> Configured:
    """What the file says now; a back end whose table and key are as `before` is the one from before. Raises
    BadSetting."""
    path, sim_url = settings.gateway_config, settings.oracle_sim_url
    config = load_config(path, oracle_allowed=sim_url is not None, noise=_noise(settings))
    where = str(path or "GATEWAY_CONFIG")
    # keys before models: what is quick to find wrong is told quickly
    sources = {
        alias: (model, api_key(alias, model, environment, where) if isinstance(model, ChatModelConfig) else None)
        for alias, model in config.models.items()
    }
    sim = Sim(sim_url, revealed(settings.sim_token))
    backends: dict[str, Backend] = {}
    for alias, (model, key) in sources.items():
        same = before is not None and before.sources.get(alias) == (model, key)
        backends[alias] = (
            before.backends[alias]
            if before is not None and same
            else _backend(alias, model, key, figures, sim, where, worker)
        )
    keys = Keys(config.keys, revealed(settings.gateway_token), config.teams, worker)
    return Configured(backends, sources, dict(config.roles), keys, _prices(config.models), config.limits)


def _prices(models: Mapping[str, ModelConfig]) -> dict[str, Price]:
    """Of the models that have one."""
    return {
        alias: Price(model.usd_per_million_prompt, model.usd_per_million_completion)
        for alias, model in models.items()
        if isinstance(model, ChatModelConfig) and model.usd_per_million_prompt + model.usd_per_million_completion > 0
    }


def _noise(settings: GatewaySettings) -> OracleNoise:
    return OracleNoise(
        miss_rate=settings.oracle_miss_rate,
        false_claim_rate=settings.oracle_false_claim_rate,
        floor_miscount_rate=settings.oracle_floor_miscount_rate,
        box_jitter=settings.oracle_box_jitter,
        refusal_rate=settings.oracle_refusal_rate,
        seed=settings.oracle_noise_seed,
    )


class Sim(NamedTuple):
    """Where the oracle asks."""

    url: str | None
    token: str | None


def _backend(
    alias: str,
    model: ModelConfig,
    key: str | None,
    figures: GatewayMetrics,
    sim: Sim,
    where: str,
    worker: Worker | None,
) -> Backend:
    if isinstance(model, ChatModelConfig):
        chat = chat_model(alias, model, where)
        places = None if worker is None else SharedPlaces(worker, f"model {alias}", model.concurrency)
        return ChatBackend(chat, Upstream(chat, key, partial(figures.retried, alias), places))
    if isinstance(model, EmbeddedModelConfig):
        return LazyBackend(alias, "embedded", partial(_embedded, alias, model))
    if isinstance(model, OracleModelConfig):
        from service_kit.client import ServiceClient  # neither is needed by a gateway to models only
        from services.vlm_gateway.backends.oracle import OracleBackend

        return OracleBackend(ServiceClient("sim", sim.url or "", token=sim.token), model)
    if isinstance(model, ExtensionModelConfig):
        return LazyBackend(alias, model.backend, partial(build_extension, alias, model))
    return ScriptedBackend(load_script(Path(model.script)), name=alias, repeat=model.repeat)


def _embedded(alias: str, model: EmbeddedModelConfig) -> Backend:
    # imported where it is needed: ONNX Runtime takes time and memory that a gateway without it should not spend
    from services.vlm_gateway.backends.embedded import EmbeddedBackend
    from services.vlm_gateway.embedded.model import EmbeddedModel

    try:
        pixel_model = EmbeddedModel()
    except (OSError, ValueError) as error:
        raise BadSetting(f"models.{alias}: the embedded model's data can't be read: {error}; reinstall it") from None
    return EmbeddedBackend(
        pixel_model,
        revision=_embedded_revision(),
        alias=alias,
        concurrency=model.concurrency,
        queue=model.queue,
        timeout_s=model.timeout_s,
    )


def _embedded_revision() -> str:
    """A hash of the embedded model's code and data: whoever changes either is not answered out of an old cache."""
    from services.vlm_gateway.embedded.exported import FOLDER

    digest = hashlib.sha256()
    for path in sorted([*FOLDER.parent.glob("*.py"), *FOLDER.glob("*.*")]):
        data = path.read_bytes()
        digest.update(f"{path.name}:{len(data)}:".encode() + data)
    return digest.hexdigest()
