"""A mission in a street with volumes to keep out of."""

import pytest

from contracts.flight_limits import FlightLimits
from contracts.geometry import Pose
from contracts.keep_out import KeepOut
from contracts.orchestrator import MissionSettings
from contracts.sim import EpisodeQuestion
from mission.mission import Mission, begin
from tests.mission.block import Block
from tests.mission.block_vehicle import BlockVehicle, BlockWorld
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


class Ground(BlockWorld):
    """Whose drones stand on the ground at first."""

    async def begin(self, question: EpisodeQuestion) -> BlockVehicle:
        vehicle = await super().begin(question)
        vehicle._set(mode="landed")
        return vehicle


def on_the_ground(low_m: float, high_m: float, log: Events, **limits: object) -> tuple[Ground, Mission]:
    """A drone beneath wires that hang between these heights, 3 m to every side of it."""
    outline = [{"x": x, "y": y} for x, y in ((-3.0, -18.0), (3.0, -18.0), (3.0, -12.0), (-3.0, -12.0))]
    wires = {"name": "wires", "outline": outline, "min_height_m": low_m, "max_height_m": high_m}
    chosen = MissionSettings.model_validate({"limits": limits | {"keep_out": [wires]}, "take_off_height_m": 2.5})
    world = Ground(Block(start=Pose(x=0.0, y=-15.0, z=0.5, yaw=1.57)))
    return world, Mission(block_ports(world), block_placement(world), chosen, log)


@pytest.mark.parametrize(("low_m", "high_m"), [(1.0, 1.3), (1.5, 2.5), (0.0, 40.0), (2.9, 40.0)])
async def test_a_drone_does_not_take_off_into_a_volume_above_it(low_m: float, high_m: float) -> None:
    log = Events()
    world, mission = on_the_ground(low_m, high_m, log)
    result = await mission.fly(REQUEST)
    assert result.outcome == "stopped_by_guard"
    assert "leads into wires" in result.message
    assert "did not take off" in result.message
    assert (world.vehicles["e1"].pose.z, result.path_m, world.ended) == (0.5, 0.0, ["e1"])
    (refused,) = log.of("refused")
    assert (refused.data.reason, refused.data.path[0].z) == ("keep_out", pytest.approx(3.0))


async def test_nor_higher_than_it_may_fly() -> None:
    world, mission = on_the_ground(6.0, 9.0, Events(), max_height_m=2.0)
    result = await mission.fly(REQUEST)
    assert (result.outcome, world.vehicles["e1"].pose.z) == ("stopped_by_guard", 0.5)
    assert "2.0 m are allowed" in result.message


async def test_it_takes_off_under_a_volume_that_leaves_room() -> None:
    world, mission = on_the_ground(6.0, 9.0, Events())
    state = begin(REQUEST, None)
    while state.drone is None and not state.over:
        state = await mission.advanced(state)
    assert not state.over
    assert world.vehicles["e1"].pose.z == pytest.approx(3.0)
