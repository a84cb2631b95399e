"""A mission in a street with volumes to keep out of."""

import pytest

from contracts.flight_limits import FlightLimits
from contracts.keep_out import KeepOut
from contracts.orchestrator import MissionSettings
from mission.mission import Mission
from tests.mission.block_vehicle import BlockWorld
from tests.mission.box_world import block_placement, block_ports
from tests.mission.test_mission import REQUEST, Events


@pytest.mark.parametrize(
    ("west", "east", "outcomes"),
    [(0.5, 6.0, {"delivered"}), pytest.param(-60.0, 60.0, {"blocked"}, marks=pytest.mark.slow)],
)
async def test_wires_before_the_window_are_flown_round_or_the_delivery_ends_before_them(
    west: float, east: float, outcomes: set[str]
) -> None:
    outline = [(west, -11.0), (east, -11.0), (east, -10.5), (west, -10.5)]
    wires = KeepOut.model_validate(
        {"name": "wires", "outline": [{"x": x, "y": y} for x, y in outline], "min_height_m": 6.0, "max_height_m": 40.0}
    )
    world, log = BlockWorld(), Events()
    settings = MissionSettings(limits=FlightLimits(keep_out=(wires,)))
    result = await Mission(block_ports(world), block_placement(world), settings, log).fly(REQUEST)
    assert result.outcome in outcomes, result.message
    for move in log.of("move"):
        here = (move.data.start.x, move.data.start.y, move.data.start.z)
        for corner in move.data.path:
            there = (corner.x, corner.y, corner.z)
            for k in range(101):
                x, y, z = (a + (b - a) * k / 100 for a, b in zip(here, there, strict=True))
                assert not (west - 0.4 < x < east + 0.4 and -11.4 < y < -10.1 and 5.6 < z < 40.4)
            here = there
