"""The orchestrator's settings."""

from pathlib import Path
from typing import ClassVar

from pydantic import Field

from contracts.flight_limits import FlightLimits
from contracts.keep_out import KeepOutFile
from mission.customer import DEFAULT_PATIENCE_S
from mission.outages import DEFAULT_WITHIN_S
from service_kit.connections import Connections
from service_kit.setting_files import read_toml
from service_kit.settings import HttpAddress, Secret, ServiceSettings, Token


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
        Path("runs"),
        description="The folder of the deliveries' records; the same one for all orchestrators, unless there is a "
        "`RECORDS_URL`.",
    )
    records_url: str | None = Field(
        None,
        description="Where the deliveries' records are kept instead: `s3://bucket/prefix`, in any store that speaks "
        "S3; `RUNS_DIR` is then each orchestrator's own.",
    )
    aws_endpoint_url: HttpAddress | None = Field(None, description="The store of `RECORDS_URL`; unset: Amazon's.")
    aws_region: str | None = Field(None, description="The region of the bucket of `RECORDS_URL`.")
    aws_access_key_id: Secret | None = Field(
        None, description="Whose key opens that bucket; unset: what AWS's own programs would take."
    )
    aws_secret_access_key: Secret | None = Field(None, description="The key itself.")
    database_url: Secret | None = Field(
        None,
        description="Where deliveries are kept: `postgresql://user:password@host/name` for several orchestrators; "
        "without it an SQLite file in `RUNS_DIR`, for one.",
    )
    fleet: Path | None = Field(
        None,
        description="A TOML file that names the vehicles which fly; without it the simulator at `SIM_URL` does.",
    )
    webhook_url: HttpAddress | None = Field(
        None, description="An address that is told of every change of a delivery's status, signed and retried."
    )
    webhook_secret: Secret | None = Field(None, description="The secret that signs what `WEBHOOK_URL` is sent.")
    runs_keep_days: float = Field(
        0.0, ge=0.0, le=36_500.0, description="Days that finished deliveries are kept, records included; 0: for ever."
    )
    runs_max_gb: float = Field(
        0.0,
        ge=0.0,
        le=1_000_000.0,
        description="GB that records may take; beyond them the oldest finished deliveries go. 0: no bound.",
    )
    max_live_deliveries: int = Field(
        2,
        ge=1,
        le=64,
        description="Deliveries that fly at a time in that simulator, where no `FLEET` says; the others wait.",
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
        DEFAULT_WITHIN_S,
        ge=0.0,
        le=3600.0,
        description="Seconds that a service or a model which does not answer is waited for, the drone holding, before "
        "the delivery ends.",
    )
    lost_after_s: float = Field(
        10.0,
        ge=1.0,
        le=3600.0,
        description="Seconds without a sign of life after which the deliveries of another orchestrator are taken over.",
    )
    max_flights: int = Field(
        3, ge=1, le=20, description="How often a delivery is begun to be flown at most, where vehicles are lost."
    )
    flight_geofence_m: float = Field(
        FlightLimits().geofence_m, ge=5.0, le=5_000.0, description="How far from its start a vehicle may fly, level."
    )
    flight_max_height_m: float = Field(
        FlightLimits().max_height_m, ge=2.0, le=500.0, description="How high above its start a vehicle may fly."
    )
    flight_roof_margin_m: float = Field(
        FlightLimits().roof_margin_m,
        ge=1.0,
        le=50.0,
        description="How far above what stands beside it a vehicle may fly.",
    )
    flight_min_clearance_m: float = Field(
        FlightLimits().min_clearance_m,
        ge=0.05,
        le=5.0,
        description="Beyond its own radius, from all that depth has shown.",
    )
    flight_max_speed_m_s: float = Field(
        FlightLimits().max_speed_m_s, ge=0.2, le=30.0, description="How fast a vehicle may fly."
    )
    flight_max_s: float = Field(
        FlightLimits().max_flight_s, ge=10.0, le=86_400.0, description="Seconds of flight, the way home included."
    )
    flight_battery_reserve: float = Field(
        FlightLimits().battery_reserve, ge=0.0, le=1.0, description="Of a full charge; kept for the unforeseen."
    )
    flight_keep_out: Path | None = Field(
        None, description="A TOML file of volumes that no flight enters, such as about overhead wires."
    )

    @property
    def flight_limits(self) -> FlightLimits:
        """What the flight guard lets no flight exceed, whatever a delivery asks for. Raises BadSetting."""
        named = self.flight_keep_out
        keep_out = read_toml("FLIGHT_KEEP_OUT", named, KeepOutFile).keep_out if named is not None else ()
        return FlightLimits(
            geofence_m=self.flight_geofence_m,
            max_height_m=self.flight_max_height_m,
            roof_margin_m=self.flight_roof_margin_m,
            min_clearance_m=self.flight_min_clearance_m,
            max_speed_m_s=self.flight_max_speed_m_s,
            max_flight_s=self.flight_max_s,
            battery_reserve=self.flight_battery_reserve,
            keep_out=keep_out,
        )
