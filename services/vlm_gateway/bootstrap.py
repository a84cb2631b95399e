"""Settings in, a wired app out. The only place that chooses the real parts."""

import hashlib
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import NamedTuple

from service_kit.metrics import HttpMetrics
from service_kit.settings import BadSetting, Settings
from services.vlm_gateway.app import build_app
from services.vlm_gateway.backends.base import Backend
from services.vlm_gateway.backends.lazy import LazyBackend
from services.vlm_gateway.backends.scripted import ScriptedBackend, load_script
from services.vlm_gateway.cache.guard import GuardedCache
from services.vlm_gateway.cache.opened import cache_of
from services.vlm_gateway.chat.backend import ChatBackend
from services.vlm_gateway.config import (
    ChatModelConfig,
    EmbeddedModelConfig,
    ModelConfig,
    OracleModelConfig,
    OracleNoise,
    api_key,
    chat_model,
    load_config,
)
from services.vlm_gateway.gateway import Gateway
from services.vlm_gateway.hot.frontend import Frontend
from services.vlm_gateway.keys import Keys
from services.vlm_gateway.metrics import GatewayMetrics, Price
from services.vlm_gateway.upstream.client import Upstream

DEFAULT_PORT = 8102


def build(settings: Settings) -> Frontend:
    """Raises BadSetting, naming what is wrong and what would be right."""
    path = settings.text("GATEWAY_CONFIG")
    sim_url = settings.text("ORACLE_SIM_URL")
    config = load_config(Path(path) if path else None, oracle_allowed=sim_url is not None, noise=_noise(settings))
    where = path or "GATEWAY_CONFIG"
    http = HttpMetrics()
    figures = GatewayMetrics(http.registry, _prices(config.models))
    # keys and cache before models: what is quick to find wrong is told quickly
    keys = {
        alias: api_key(alias, model, settings, where)
        for alias, model in config.models.items()
        if isinstance(model, ChatModelConfig)
    }
    cache = _guarded_cache(settings, figures)
    sim = Sim(sim_url, settings.text("ORACLE_SIM_TOKEN"))
    backends = {
        alias: _backend(alias, model, keys.get(alias), figures, sim, where) for alias, model in config.models.items()
    }
    gateway = Gateway(backends, config.roles, cache, figures)
    callers = Keys(config.keys, settings.text("GATEWAY_TOKEN"))
    return build_app(gateway, http, keys=callers, log_share=settings.number("REQUEST_LOG_SHARE", 0.01, 0.0, 1.0))


def _prices(models: Mapping[str, ModelConfig]) -> dict[str, Price]:
    """Of the models that have one."""
    return {
        alias: Price(model.usd_per_million_prompt, model.usd_per_million_completion)
        for alias, model in models.items()
        if isinstance(model, ChatModelConfig) and model.usd_per_million_prompt + model.usd_per_million_completion > 0
    }


def _noise(settings: Settings) -> OracleNoise:
    def rate(name: str) -> float:
        return settings.number(name, 0.0, 0.0, 1.0)

    return OracleNoise(
        miss_rate=rate("ORACLE_MISS_RATE"),
        false_claim_rate=rate("ORACLE_FALSE_CLAIM_RATE"),
        floor_miscount_rate=rate("ORACLE_FLOOR_MISCOUNT_RATE"),
        box_jitter=rate("ORACLE_BOX_JITTER"),
        refusal_rate=rate("ORACLE_REFUSAL_RATE"),
        seed=settings.integer("ORACLE_NOISE_SEED", 0, 0, 2**31 - 1),
    )


class Sim(NamedTuple):
    """Where the oracle asks."""

    url: str | None
    token: str | None


def _backend(alias: str, model: ModelConfig, key: str | None, figures: GatewayMetrics, sim: Sim, where: str) -> Backend:
    if isinstance(model, ChatModelConfig):
        chat = chat_model(alias, model, where)
        return ChatBackend(chat, Upstream(chat, key, partial(figures.retried, alias)))
    if isinstance(model, EmbeddedModelConfig):
        return LazyBackend(alias, "embedded", partial(_embedded, alias, model))
    if isinstance(model, OracleModelConfig):
        from service_kit.client import ServiceClient  # neither is needed by a gateway to models only
        from services.vlm_gateway.backends.oracle import OracleBackend

        return OracleBackend(ServiceClient("sim", sim.url or "", token=sim.token), model)
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


def _guarded_cache(settings: Settings, figures: GatewayMetrics) -> GuardedCache | None:
    mode = settings.choice("CACHE_MODE", "on", ("on", "off", "replay"))
    if mode == "off":
        return None
    cache = cache_of(settings)
    return GuardedCache(cache, "replay" if mode == "replay" else "on", figures.cache_failed)
