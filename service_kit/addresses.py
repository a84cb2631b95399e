"""Where the services listen: their usual ports, and other addresses that somebody gives."""

from dataclasses import dataclass

PORTS = {"orchestrator": 8100, "llm_parser": 8101, "vlm_gateway": 8102, "depth_assist": 8103, "sim": 8104}
VEHICLE_PORTS = {"mavlink_vehicle": 8105, "carla_world": 8106}
"""Of services that fly other vehicles than the simulator's."""
REPLAY_PORT = 8110
"""Where `logisticsvln replay` shows the records of a run."""
FLIGHT_SERVICES = ("sim", "depth_assist", "vlm_gateway", "llm_parser")
"""What a delivery needs beside the orchestrator."""


@dataclass(frozen=True)
class Addresses:
    """Where the four services listen."""

    llm_parser: str = "http://127.0.0.1:8101"
    vlm_gateway: str = "http://127.0.0.1:8102"
    depth_assist: str = "http://127.0.0.1:8103"
    sim: str = "http://127.0.0.1:8104"
