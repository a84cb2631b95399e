"""The simulator's settings."""

from pathlib import Path
from typing import ClassVar, Literal

from pydantic import Field

from contracts.sim import MAX_LEASE_S
from service_kit.settings import ServiceSettings, Token


class SimSettings(ServiceSettings):
    """All optional."""

    prefixes: ClassVar = ("SIM_",)

    port: int = Field(8104, ge=1, le=65535, description="The TCP port to listen at.")
    sim_token: Token | None = Field(None, description="Callers must send this bearer token; without it all may call.")
    sim_renderer: Literal["auto", "moderngl", "tiny"] = Field(
        "auto", description="What draws: OpenGL, PyBullet's TinyRenderer, or OpenGL where it can be had."
    )
    sim_max_episodes: int = Field(16, ge=1, le=500, description="Episodes that may be live at a time.")
    sim_max_episodes_per_owner: int = Field(
        0, ge=0, le=500, description="Episodes of one owner that may be live at a time; 0: as many as there is room."
    )
    sim_lease_s: float = Field(
        60.0,
        ge=1.0,
        le=MAX_LEASE_S,
        description="Seconds without a call until an episode is ended, where whoever began it did not say.",
    )
    sim_max_lease_s: float = Field(
        3600.0, ge=1.0, le=MAX_LEASE_S, description="The longest lease that an episode may be begun with."
    )
    sim_kept_scenes: int = Field(4, ge=0, le=100, description="Built scenes kept in memory that no episode uses.")
    sim_things: Path | None = Field(
        None, description="A folder of object classes and textures of your own (docs/scenes.md)."
    )
    sim_truth: bool = Field(False, description="Whether the oracle may ask what is really there.")
