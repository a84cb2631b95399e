"""The orchestrator's settings."""

from pathlib import Path
from typing import ClassVar

from pydantic import Field

from mission.customer import DEFAULT_PATIENCE_S
from service_kit.connections import Connections
from service_kit.settings import ServiceSettings, Token


class OrchestratorSettings(Connections, ServiceSettings):
    """All optional."""

    prefixes: ClassVar = ("ORCHESTRATOR_",)

    port: int = Field(8100, ge=1, le=65535, description="The TCP port to listen at.")
    orchestrator_token: Token | None = Field(
        None, description="Callers must send this bearer token; without it all may call."
    )
    runs_dir: Path = Field(Path("runs"), description="The folder of the deliveries' records.")
    max_live_deliveries: int = Field(2, ge=1, le=64, description="Deliveries that may be under way at a time.")
    max_waiting_deliveries: int = Field(
        50,
        ge=0,
        le=10_000,
        description="Deliveries that may wait on the ground for an answer; beyond them nobody is asked.",
    )
    answer_within_s: float = Field(
        DEFAULT_PATIENCE_S,
        ge=0.0,
        le=86_400.0,
        description="Seconds that a customer's answer is waited for, where the delivery does not say; with 0 nobody is "
        "asked.",
    )
