"""The orchestrator's settings."""

from pathlib import Path
from typing import ClassVar

from pydantic import Field

from mission.customer import DEFAULT_PATIENCE_S
from service_kit.connections import Connections
from service_kit.settings import Secret, ServiceSettings, Token


class OrchestratorSettings(Connections, ServiceSettings):
    """All optional."""

    prefixes: ClassVar = ("ORCHESTRATOR_",)

    port: int = Field(8100, ge=1, le=65535, description="The TCP port to listen at.")
    orchestrator_token: Token | None = Field(
        None, description="The operator's token, which may do everything; without it all may call."
    )
    orchestrator_read_token: Token | None = Field(None, description="A second token, which may look on only.")
    orchestrator_key: Token | None = Field(
        None,
        description="What sessions and customers' links are signed with; unset: a key that is drawn once and kept in "
        "RUNS_DIR.",
    )
    session_hours: int = Field(12, ge=1, le=8760, description="Hours until a browser has to log in again.")
    runs_dir: Path = Field(
        Path("runs"), description="The folder of the deliveries' records; the same one for all orchestrators."
    )
    database_url: Secret | None = Field(
        None,
        description="Where deliveries are kept: `postgresql://user:password@host/name` for several orchestrators; "
        "without it an SQLite file in `RUNS_DIR`, for one.",
    )
    max_live_deliveries: int = Field(
        2, ge=1, le=64, description="Deliveries that fly at a time in the simulator; the others wait."
    )
    max_waiting_deliveries: int = Field(
        100_000, ge=1, le=10_000_000, description="Deliveries that may wait; further ones are refused."
    )
    answer_within_s: float = Field(
        DEFAULT_PATIENCE_S,
        ge=0.0,
        le=86_400.0,
        description="Seconds that a customer's answer is waited for, where the delivery does not say; with 0 nobody is "
        "asked.",
    )
    service_within_s: float = Field(
        30.0,
        ge=0.0,
        le=3600.0,
        description="Seconds that a service which does not answer is asked again before the delivery ends.",
    )
    max_flights: int = Field(
        3, ge=1, le=20, description="How often a delivery is begun to be flown at most, where vehicles are lost."
    )
