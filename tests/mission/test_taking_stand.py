"""The beginning of a flight: from wherever the drone stands, square before the facade and under open sky."""

import math
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from numpy.typing import NDArray

from contracts.cameras import Camera
from contracts.flight_limits import FlightLimits
from contracts.geometry import Pose
from contracts.orchestrator import DeliveryResult, MissionSettings
from contracts.vlm_gateway import FloorCountAnswer, FloorCountQuestion
from mission.mission import Mission
from tests.mission.block import Block, StereoBlock
from tests.mission.block_vehicle import BlockWorld
from tests.mission.box_world import WHO, BlockVision, block_placement, block_ports
from tests.mission.test_mission import REQUEST, Events

FACING = math.pi / 2


async def flown(block: Block, log: Events) -> DeliveryResult:
    world = BlockWorld(block)
    result = await Mission(block_ports(world), block_placement(world), MissionSettings(), log).fly(REQUEST)
    assert not world.vehicles["e1"].collided
    return result


def start(y: float, off_deg: float = 0.0) -> Block:
    return Block(start=Pose(x=0.0, y=y, z=1.5, yaw=FACING + math.radians(off_deg)))


@pytest.mark.parametrize(
    ("y", "off_deg"),
    [(-7.2, 0.0), (-7.5, 0.0), (-36.0, 0.0), (-44.0, 0.0), (-15.0, 50.0), (-15.0, -40.0), (-15.0, 180.0)],
)
async def test_from_too_near_too_far_turned_off_or_away_the_right_floor_is_found(y: float, off_deg: float) -> None:
    log = Events()
    result = await flown(start(y, off_deg), log)
    assert result.outcome == "delivered"
    (stand,) = [e.data for e in log.of("stand_off")]
    assert 4.0 <= stand.stand_off_m <= 14.5
    assert abs(math.remainder(stand.pose.yaw - FACING, math.tau)) < math.radians(10.0)
    assert result.final_height_m == pytest.approx(10.5, abs=0.8)
    assert all(e.phase != "place" or e.kind != "look" for e in log)  # no model is asked for it


async def test_a_good_start_is_left_as_it_is() -> None:
    log = Events()
    await flown(start(-15.0), log)
    assert not [e for e in log if e.phase == "place" and e.kind in {"move", "turn"}]


async def test_a_sensor_of_short_reach_begins_from_nearer() -> None:
    log = Events()
    block = StereoBlock(start=Pose(x=0.0, y=-15.0, z=1.5, yaw=FACING), range_m=10.0)
    result = await flown(block, log)
    assert result.outcome == "delivered"
    assert next(e.data for e in log.of("stand_off")).stand_off_m < 6.5


@pytest.mark.parametrize("side", [-1.0, 1.0])
async def test_a_house_beside_the_drone_is_not_taken_for_the_one_out_of_its_sensors_reach(side: float) -> None:
    log = Events()
    beside = Block(*sorted((4.0 * side, 14.0 * side)), y0=-42.0, y1=-30.0, floors=4)
    start_at = Pose(x=0.0, y=-36.0, z=1.5, yaw=FACING)
    result = await flown(StereoBlock(start=start_at, range_m=20.0, neighbour=beside), log)
    assert result.outcome == "delivered"
    (stand,) = [e.data for e in log.of("stand_off")]
    assert abs(math.remainder(stand.pose.yaw - FACING, math.tau)) < math.radians(10.0)


async def test_what_has_no_floors_is_no_building_and_the_drone_looks_elsewhere() -> None:
    """A hedge behind it, and the building in front out of its sensors' reach."""
    log = Events()
    hedge = Block(x0=-4.0, x1=4.0, y0=-48.0, y1=-44.0, floors=1)
    world = BlockWorld(StereoBlock(start=Pose(x=0.0, y=-36.0, z=1.5, yaw=FACING), range_m=20.0, neighbour=hedge))
    none = FloorCountAnswer(role="floors", floors=0, **WHO)
    vision = BlockVision(world, says={"floor_count": [none, none]})
    result = await Mission(block_ports(world, vision), block_placement(world), MissionSettings(), log).fly(REQUEST)
    assert result.outcome == "delivered"
    first, second = (e.data for e in log.of("stand_off"))
    assert abs(math.remainder(first.pose.yaw + FACING, math.tau)) < math.radians(15.0)
    assert abs(math.remainder(second.pose.yaw - FACING, math.tau)) < math.radians(10.0)
    assert not world.vehicles["e1"].collided


async def test_from_what_is_no_building_the_drone_turns_to_where_it_looked_when_it_began() -> None:
    log = Events()
    hedge = Block(x0=-4.0, x1=4.0, y0=-48.0, y1=-44.0, floors=1)
    began = FACING - 0.5
    world = BlockWorld(StereoBlock(start=Pose(x=0.0, y=-36.0, z=1.5, yaw=began), range_m=20.0, neighbour=hedge))
    vision = BlockVision(world, says={"floor_count": [FloorCountAnswer(role="floors", floors=0, **WHO)] * 2})
    await Mission(block_ports(world, vision), block_placement(world), MissionSettings(), log).fly(REQUEST)
    away = next(e.data for e in log if e.message.startswith("that is no building"))
    assert away.to.yaw == pytest.approx(began, abs=0.01)


async def test_windows_under_the_eaves_are_looked_for_from_below_before_a_house_is_left() -> None:
    """From above the roof of a low house its windows don't show."""
    log = Events()
    start_at = Pose(x=0.0, y=-20.0, z=1.5, yaw=FACING)
    world = BlockWorld(Block(start=start_at, floors=4, floor_height_m=2.1, thing=(3.0, -6.2, 7.35)))
    vision = BlockVision(world, says={"floor_count": [FloorCountAnswer(role="floors", floors=0, **WHO)]})
    result = await Mission(block_ports(world, vision), block_placement(world), MissionSettings(), log).fly(REQUEST)
    assert result.outcome == "delivered"
    assert len(log.of("stand_off")) == 1
    assert [e.data.floors_new for e in log.of("floor_count")][:2] == [0, 4]


async def test_floors_taller_than_floors_are_are_counted_once_more() -> None:
    """Its roof is above the first picture; a taller house beside it lets the drone rise past it."""
    log = Events()
    beside = Block(x0=-20.0, x1=-9.0, floors=12)
    start_at = Pose(x=0.0, y=-15.0, z=1.5, yaw=FACING)
    world = BlockWorld(Block(start=start_at, floor_height_m=2.995, thing=(3.0, -6.2, 10.48), neighbour=beside))
    said = [FloorCountAnswer(role="floors", floors=floors, **WHO) for floors in (1, 0)]
    vision = BlockVision(world, says={"floor_count": said})
    result = await Mission(block_ports(world, vision), block_placement(world), MissionSettings(), log).fly(REQUEST)
    assert [e.data.floors_new for e in log.of("floor_count")][:3] == [1, 0, 6]
    assert result.outcome == "delivered"


@dataclass(frozen=True)
class Mirage(StereoBlock):
    """Its neighbour is not there, and does not show for a drone that faces it."""

    def distance(self, x: float, y: float, z: float) -> float:
        return super(Mirage, replace(self, neighbour=None)).distance(x, y, z)

    def depth_m(self, pose: Pose, camera: Camera) -> NDArray[np.float64]:
        faced = abs(math.remainder(pose.yaw - math.pi, math.tau)) < math.radians(30.0)
        block = replace(self, neighbour=None) if faced and self.neighbour is not None else self
        return super(Mirage, block).depth_m(pose, camera)


async def test_from_what_turns_out_to_be_no_wall_the_drone_goes_back_to_where_it_looked_and_on() -> None:
    log = Events()
    beside = Block(x0=-12.0, x1=-6.0, y0=-40.0, y1=-30.0, floors=3)
    start_at = Pose(x=0.0, y=-36.0, z=1.5, yaw=FACING + math.radians(20.0))
    result = await flown(Mirage(start=start_at, range_m=10.0, neighbour=beside), log)
    turns = [e.message for e in log.of("turn")]
    assert turns[:2] == ["turn to the building", "nothing nearer behind: back to where the drone looked first"]
    assert result.outcome == "delivered"


@dataclass(frozen=True)
class AtTheEndOfReach(StereoBlock):
    """A drone that is square to it sees it from no farther than 8 m."""

    def depth_m(self, pose: Pose, camera: Camera) -> NDArray[np.float64]:
        square = abs(math.remainder(pose.yaw - FACING, math.tau)) < math.radians(15.0)
        depth = super().depth_m(pose, camera)
        with np.errstate(invalid="ignore"):
            return np.where(depth > 8.0, np.nan, depth) if square else depth


async def test_to_a_wall_behind_that_shows_only_now_and_then_the_drone_flies_on_and_not_back() -> None:
    log = Events()
    away = FACING + math.pi + math.radians(35.0)
    near = Block().y0 - 9.0
    result = await flown(AtTheEndOfReach(start=Pose(x=0.0, y=near, z=1.5, yaw=away), range_m=12.0), log)
    turns = [e.message for e in log.of("turn")]
    assert turns[:2] == ["no building close ahead: look behind", "turn square to the facade"]
    assert not [said for said in turns if said.startswith("nothing nearer behind")]
    assert result.outcome == "delivered"


async def test_past_the_end_of_a_wall_that_it_is_square_to_the_drone_flies_on() -> None:
    log = Events()
    wing = Block(x0=-20.0, x1=-4.5, y0=-29.0, y1=-24.0, floors=3)
    start_at = Pose(x=0.0, y=-36.0, z=1.5, yaw=FACING)
    result = await flown(StereoBlock(start=start_at, range_m=10.0, neighbour=wing), log)
    assert result.outcome == "delivered"
    assert sum(e.message == "turn to the building" for e in log.of("turn")) <= 2


async def test_a_bare_house_as_high_as_may_be_flown_is_left_for_another() -> None:
    """Behind it, and the building in front out of its sensors' reach."""
    log = Events()
    bare = Block(x0=-6.0, x1=6.0, y0=-60.0, y1=-44.0, floors=9)
    start_at = Pose(x=0.0, y=-36.0, z=1.5, yaw=FACING)
    world = BlockWorld(StereoBlock(start=start_at, range_m=10.0, neighbour=bare))
    none = FloorCountAnswer(role="floors", floors=0, **WHO)

    class OnlyItsOwn(BlockVision):
        async def floor_count(self, question: FloorCountQuestion) -> FloorCountAnswer:
            return await super().floor_count(question) if world.vehicles["e1"].pose.y > -30.0 else none

    result = await Mission(block_ports(world, OnlyItsOwn(world)), block_placement(world), MissionSettings(), log).fly(
        REQUEST
    )
    assert [e for e in log if e.message.startswith("that is no building")]
    assert result.outcome == "delivered"
    assert not world.vehicles["e1"].collided


@dataclass(frozen=True)
class BrokenFrame(StereoBlock):
    """Of the second look straight ahead only the upper quarter arrives."""

    looks_ahead: list[Pose] = field(default_factory=list)

    def depth_m(self, pose: Pose, camera: Camera) -> NDArray[np.float64]:
        depth = super().depth_m(pose, camera)
        if camera.heading_deg == 0.0:
            self.looks_ahead.append(pose)
            if len(self.looks_ahead) == 2:
                depth[len(depth) // 4 :] = np.nan
        return depth


async def test_where_only_a_part_of_a_frame_arrives_the_facade_is_looked_for_again() -> None:
    log = Events()
    result = await flown(BrokenFrame(range_m=20.0), log)
    assert len(log.of("stand_off")) == 1
    assert result.outcome == "delivered"


async def test_where_no_building_stands_it_says_so() -> None:
    nowhere = replace(Block(), y0=300.0, y1=310.0)
    result = await flown(nowhere, Events())
    assert result.outcome == "no_building"
    assert "no building" in result.message
    assert result.steps == 0


@pytest.mark.parametrize(
    ("y", "off_deg", "said"),
    [(-7.2, 0.0, "too near"), (-44.0, 0.0, "too far"), (-15.0, 180.0, "stood ahead")],
)
async def test_what_was_amiss_where_it_began_is_said_and_stands_beside_why_nothing_was_found(
    y: float, off_deg: float, said: str
) -> None:
    log = Events()
    world = BlockWorld(start(y, off_deg))
    asked = REQUEST.replace("floor 4", "floor 9")
    result = await Mission(block_ports(world), block_placement(world), MissionSettings(), log).fly(asked)
    assert result.outcome == "floor_not_found"
    assert said in result.message
    assert [e for e in log if e.phase == "place" and e.kind == "phase" and said in e.message]


async def test_of_a_good_start_nothing_is_said() -> None:
    world = BlockWorld(start(-15.0))
    asked = REQUEST.replace("floor 4", "floor 9")
    result = await Mission(block_ports(world), block_placement(world), MissionSettings(), Events()).fly(asked)
    assert "began" not in result.message


class ThreeFloorsAhead(BlockVision):
    """The house that the drone faces when it begins has three floors."""

    async def floor_count(self, question: FloorCountQuestion) -> FloorCountAnswer:
        said = await super().floor_count(question)
        return FloorCountAnswer(role="floors", floors=3, **WHO) if self.world.pose.yaw < 0.0 else said


async def flown_with_its_back_to(floor: int, log: Events) -> DeliveryResult:
    """The customer's house stands near behind the drone, another far ahead."""
    ahead = Block(x0=-10.0, x1=10.0, y0=-40.0, y1=-24.0, floors=3)
    start_at = Pose(x=0.0, y=-7.2, z=1.5, yaw=-FACING)
    world = BlockWorld(StereoBlock(start=start_at, range_m=20.0, neighbour=ahead))
    mission = Mission(block_ports(world, ThreeFloorsAhead(world)), block_placement(world), MissionSettings(), log)
    result = await mission.fly(REQUEST.replace("floor 4", f"floor {floor}"))
    assert not world.vehicles["e1"].collided
    return result


async def test_a_house_far_ahead_without_the_floor_asked_for_is_left_for_the_one_behind() -> None:
    log = Events()
    result = await flown_with_its_back_to(4, log)
    first, last = (e.data.pose.yaw for e in log.of("stand_off"))
    assert (first, last) == (pytest.approx(-FACING, abs=0.3), pytest.approx(FACING, abs=0.3))
    assert [e for e in log if e.message == "this building has no floor 4: look for another"]
    assert result.outcome == "delivered"


async def test_where_no_house_about_has_the_floor_asked_for_both_are_told() -> None:
    result = await flown_with_its_back_to(9, Events())
    assert result.outcome == "floor_not_found"
    assert result.message.startswith("3 floors were counted up to the facade's top at 9.0 m; there is no floor 9")
    assert "another building was looked for: 6 floors were counted" in result.message


async def test_from_the_foot_of_a_house_no_other_is_looked_for() -> None:
    log = Events()
    world = BlockWorld(start(-11.0))
    asked = REQUEST.replace("floor 4", "floor 9")
    result = await Mission(block_ports(world), block_placement(world), MissionSettings(), log).fly(asked)
    assert result.outcome == "floor_not_found"
    assert len(log.of("stand_off")) == 1


async def test_the_operators_highest_height_is_not_taken_for_the_roof() -> None:
    """Ten floors, 10 m allowed, and a start from which the house might be another's."""
    log = Events()
    world = BlockWorld(Block(floors=10, start=Pose(x=0.0, y=-22.0, z=1.5, yaw=FACING)))
    limits = FlightLimits(max_height_m=10.0)
    mission = Mission(block_ports(world), block_placement(world), MissionSettings(), log, limits=limits)
    result = await mission.fly(REQUEST.replace("floor 4", "floor 8"))
    assert result.outcome == "floor_not_found"
    assert result.message.startswith("no higher than 10 m may be flown, and no floor 8 was found up to there")
    assert len(log.of("stand_off")) == 1
    assert not [e for e in log if "once more" in e.message or "another" in e.message]
