"""The service's settings."""

from pathlib import Path
from typing import ClassVar

from pydantic import Field

from contracts.sim import MAX_LEASE_S
from service_kit.settings import ServiceSettings, Token


class CarlaWorldSettings(ServiceSettings):
    """All optional."""

    prefixes: ClassVar = ("CARLA_",)

    port: int = Field(8106, ge=1, le=65535, description="The TCP port to listen at.")
    carla_world_token: Token | None = Field(
        None, description="Callers must send this bearer token; without it all may call."
    )
    carla: str = Field("127.0.0.1:2000", description="host:port of CARLA's server; the next port has its streams.")
    carla_scenes: Path = Field(
        Path("carla-scenes"), description="The folder of the documents that say where scenes lie in CARLA's maps."
    )
    carla_timeout_s: float = Field(
        20.0, ge=0.1, le=600.0, description="Seconds that CARLA's server may take for an answer or a picture."
    )
    carla_load_timeout_s: float = Field(120.0, ge=1.0, le=3600.0, description="Seconds it may take to load a map.")
    carla_tick_s: float = Field(0.05, ge=0.001, le=1.0, description="Seconds of the simulated world in one tick.")
    carla_settle_ticks: int = Field(
        3,
        ge=0,
        le=100,
        description="Ticks between a camera's jump and its picture: exposure and textures follow with a delay.",
    )
    carla_world_lease_s: float = Field(
        60.0,
        ge=1.0,
        le=MAX_LEASE_S,
        description="Seconds without a call until an episode is ended, where whoever began it did not say.",
    )
    carla_world_max_lease_s: float = Field(
        3600.0, ge=1.0, le=MAX_LEASE_S, description="The longest lease that an episode may be begun with."
    )
