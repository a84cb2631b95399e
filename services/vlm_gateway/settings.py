"""The settings of vlm_gateway. Its models, roles and keys are configured in the TOML file that GATEWAY_CONFIG names."""

from pathlib import Path
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from service_kit.settings import HttpAddress, Secret, ServiceSettings, Settings, Token

Rate = Annotated[float, Field(ge=0.0, le=1.0)]


class CacheSettings(Settings):
    """Where answers are kept; read by the gateway and by the command that makes recordings."""

    cache_mode: Literal["on", "off", "replay"] = Field(
        "on", description="`replay` answers from what is kept alone and asks no model."
    )
    cache_path: Path = Field(
        Path("~/.cache/logisticsvln/answers.sqlite"), description="The SQLite file of the answers, without REDIS_URL."
    )
    redis_url: Secret | None = Field(
        None, description="A Redis for the answers instead of the file, such as redis://:password@host:6379/0."
    )
    cache_ttl_s: float = Field(
        30 * 86_400.0, ge=0.0, le=10 * 365 * 86_400.0, description="Seconds an answer is kept; 0: for ever."
    )
    cache_timeout_s: float = Field(
        0.04, ge=0.001, le=10.0, description="Seconds that a reply of Redis may take, and connecting to it."
    )
    cache_max_mb: int = Field(256, ge=1, le=1024 * 1024, description="The SQLite file's largest size in MiB.")


class GatewaySettings(CacheSettings, ServiceSettings):
    """All optional."""

    prefixes: ClassVar = ("GATEWAY_", "VLM_GATEWAY_", "ORACLE_", "CACHE_", "USAGE_")

    port: int = Field(8102, ge=1, le=65535, description="The TCP port to listen at.")
    workers: int = Field(
        1, ge=1, le=32, description="Processes that share the port, the places of models and the limits of keys."
    )
    cors_origins: str = Field(
        "", description="Web pages that may ask, comma-separated, such as https://ground.example; `*`: all."
    )
    gateway_config: Path | None = Field(None, description="The TOML file of models, roles and keys (docs/gateway.md).")
    gateway_token: Token | None = Field(
        None, description="The operator's token, which may do everything; without it and without keys all may call."
    )
    usage_path: Path | None = Field(
        None, description="The SQLite file of what keys and teams have spent; unset: usage.sqlite beside CACHE_PATH."
    )
    usage_redis_url: Secret | None = Field(
        None,
        description="A Redis that evicts nothing, for the same, shared by replicas; unset: REDIS_URL, if set.",
    )
    request_log_share: Rate = Field(
        0.01,
        description="The share of chats that get a line in the log; those answered with 500 or more always get one (20 "
        "each half second at most), unless this is 0.",
    )
    otel_exporter_otlp_endpoint: HttpAddress | None = Field(
        None, description="An OpenTelemetry collector to send traces to, such as http://127.0.0.1:4318 (extra `otel`)."
    )
    oracle_sim_url: HttpAddress | None = Field(
        None, description="The simulator that the back end `oracle` asks; unset: there is no such back end."
    )
    sim_token: Token | None = Field(None, description="The token to send to that simulator.")
    oracle_miss_rate: Rate = Field(0.0, description="The oracle's noise: how often it misses an object in sight.")
    oracle_false_claim_rate: Rate = Field(0.0, description="How often it names another object instead.")
    oracle_floor_miscount_rate: Rate = Field(0.0, description="How often it is wrong by one floor.")
    oracle_box_jitter: Rate = Field(0.0, description="How far its boxes are off, as a share of their size.")
    oracle_refusal_rate: Rate = Field(0.0, description="How often it declines to answer.")
    oracle_noise_seed: int = Field(0, ge=0, le=2**31 - 1, description="The seed of that noise.")
