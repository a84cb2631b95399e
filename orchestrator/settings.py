"""The orchestrator's settings."""

from pathlib import Path
from typing import ClassVar

from pydantic import Field

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
