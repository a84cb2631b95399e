"""The settings of mavlink_vehicle."""

from pathlib import Path
from typing import ClassVar, Literal

from pydantic import Field

from contracts.base import Name
from service_kit.addresses import Addresses
from service_kit.settings import HttpAddress, ServiceSettings, Token


class MavlinkVehicleSettings(ServiceSettings):
    """All optional."""

    prefixes: ClassVar = ("MAVLINK_VEHICLE_",)

    port: int = Field(8105, ge=1, le=65535, description="The TCP port to listen at.")
    mavlink_vehicle_token: Token | None = Field(
        None, description="Callers must send this bearer token; without it all may call."
    )
    autopilot: str = Field(
        "udpin://127.0.0.1:14540",
        min_length=1,
        max_length=200,
        description="Where the autopilot is heard, as MAVSDK writes it: `udpin://`, `udpout://`, `tcpout://host:port`, "
        "`serial:///dev/...:baud`.",
    )
    cameras: Path | None = Field(
        None,
        description="A TOML file that names the vehicle's cameras (docs/vehicles.md); without it the simulator at "
        "`SIM_URL` draws what they would see.",
    )
    sim_url: HttpAddress = Field(Addresses().sim, description="Where the simulator listens.")
    sim_token: Token | None = Field(None, description="The token that the simulator asks for.")
    vehicle_name: Name = Field("vehicle", description="What the vehicle calls itself.")
    vehicle_arms_within_s: float = Field(
        30.0, ge=0.0, le=600.0, description="For so long an autopilot that refuses to arm is asked again."
    )
    vehicle_radius_m: float = Field(0.35, ge=0.05, le=5.0, description="Of a ball that holds all of the vehicle.")
    vehicle_max_speed_m_s: float = Field(3.0, ge=0.2, le=20.0, description="How fast its set-points move.")
    vehicle_max_climb_m_s: float = Field(2.0, ge=0.1, le=10.0, description="How fast they rise.")
    vehicle_max_sink_m_s: float = Field(
        1.2, ge=0.1, le=5.0, description="How fast they sink: quadrotors sink badly through their own wake."
    )
    vehicle_max_acceleration_m_s2: float = Field(
        1.5, ge=0.1, le=10.0, description="How fast their speed changes; it brakes within that too."
    )
    vehicle_max_yaw_rate_deg_s: float = Field(45.0, ge=1.0, le=360.0, description="How fast they turn.")
    vehicle_battery_reserve: float = Field(
        0.2, ge=0.0, le=0.9, description="Of a full battery, kept for the way home; told with its state."
    )
    vehicle_arrives_within_m: float = Field(
        0.3, ge=0.05, le=3.0, description="As near as that to its end a flight is over; it waits 12 s for it."
    )
    vehicle_after_mission: Literal["hold", "return", "land"] = Field(
        "hold",
        description="What it does when a mission needs it no more and it flies with cameras of its own: it stays in "
        "the air by itself, returns by the autopilot's own way and lands, or lands where it is.",
    )
    vehicle_lease_s: float = Field(
        60.0, ge=5.0, le=86_400.0, description="Seconds without a call until a trial is over, and the vehicle lands."
    )
