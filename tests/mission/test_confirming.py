"""The height that was counted, confirmed by one more count there, and what is said where nothing confirms it."""

from dataclasses import dataclass

import pytest

from contracts.orchestrator import DeliveryResult, MissionSettings
from contracts.vlm_gateway import FloorCountAnswer, FloorCountQuestion
from mission.mission import Mission
from tests.mission.block import Block
from tests.mission.block_vehicle import BlockWorld
from tests.mission.box_world import WHO, BlockVision, block_placement, block_ports
from tests.mission.test_mission import REQUEST, Events


@dataclass
class TellsRows(BlockVision):
    """Counts the rows in sight before the first facade, and tells them."""

    async def floor_count(self, question: FloorCountQuestion) -> FloorCountAnswer:
        pose, block = self._pose("floor_count"), self.world.block
        away_m = block.y0 - pose.y
        middles = [(k + 0.5) * block.floor_height_m for k in reversed(range(block.floors))]
        rows = [0.5 - (z - pose.z) / (2.0 * away_m) for z in middles]
        return self._said("floor_count", answered(tuple(row for row in rows if 0.0 < row < 1.0)))


def answered(rows: tuple[float, ...]) -> FloorCountAnswer:
    return FloorCountAnswer(role="floors", floors=len(rows), rows=rows, **WHO)


def counted(floors: int) -> FloorCountAnswer:
    return FloorCountAnswer(role="floors", floors=floors, **WHO)


async def flown(block: Block, log: Events, says: list[FloorCountAnswer | None]) -> DeliveryResult:
    world = BlockWorld(block)
    ports = block_ports(world, TellsRows(world, says={"floor_count": says}))
    return await Mission(ports, block_placement(world), MissionSettings(), log).fly(REQUEST)


async def test_a_right_height_is_confirmed_without_another_stop() -> None:
    log = Events()
    result = await flown(Block(), log, [])
    assert result.outcome == "delivered"
    (check,) = [e.data for e in log.of("height_check")]
    assert (check.floor_seen, check.confirmed) == (4, True)
    (box,) = [e.data for e in log.of("building_box")]
    assert box.pose == check.pose


@pytest.mark.parametrize("miscounted", [5, 7, 8])
async def test_a_miscounted_height_is_mended_by_one_more_count_there(miscounted: int) -> None:
    log = Events()
    result = await flown(Block(), log, [counted(miscounted)])
    assert result.outcome == "delivered"
    assert result.final_height_m == pytest.approx(10.5, abs=0.5)
    assert log.of("height_check")[-1].data.confirmed


async def test_two_counts_that_contradict_each_other_leave_the_height_as_it_was_first() -> None:
    log = Events()
    fifth, third = answered((0.5, 0.633, 0.767, 0.9)), answered((0.5, 0.667, 0.833))
    result = await flown(Block(), log, [None, fifth, third])
    assert result.final_height_m == pytest.approx(10.5, abs=0.1)
    assert [e.data.confirmed for e in log.of("height_check")] == [False, False]


async def test_where_no_row_confirms_the_height_no_floor_is_said_to_be_inspected() -> None:
    log = Events()
    nowhere = Block(thing=(300.0, 300.0, 10.5))
    result = await flown(nowhere, log, [None, answered((0.05,))])
    assert result.outcome == "object_not_found"
    assert "no row of windows confirmed" in result.message
    assert "of the facade on floor" not in result.message
    confirmed = await flown(nowhere, Events(), [])
    assert "of the facade on floor 4 inspected" in confirmed.message


async def test_before_there_is_no_such_floor_all_floors_are_counted_once_more_from_half_the_height() -> None:
    log = Events()
    result = await flown(Block(floors=5), log, [counted(3)])
    assert result.outcome == "delivered"
    assert result.final_height_m == pytest.approx(10.5, abs=0.5)
    first, again = [e.data for e in log.of("floor_count")]
    assert [(e.floors_new, e.decision) for e in (first, again)] == [(3, "FloorNotFound"), (5, "FinalHeight")]
    assert again.pose.z == pytest.approx(first.facade_top_m / 2.0, abs=0.5)


async def test_a_count_that_mixes_two_walls_rows_is_made_again_with_the_wall_ahead_alone() -> None:
    log = Events()
    # a wing farther off puts rows of its own between those of the wall ahead
    mixed = answered((0.15, 0.2, 0.28, 0.34, 0.45, 0.5, 0.6, 0.65))
    result = await flown(Block(), log, [mixed])
    assert result.outcome == "delivered"
    (count,) = [e.data for e in log.of("floor_count")]
    assert count.floors_new == 6
    assert log.of("height_check")[-1].data.confirmed


async def test_floors_too_low_to_live_on_leave_what_stands_on_the_floor_asked_for_on_it() -> None:
    log = Events()
    mixed = answered((0.15, 0.2, 0.28, 0.34, 0.45, 0.5, 0.6, 0.65))
    # a thing on the floor's ground, 1.2 m below the middle of its window; the wall ahead alone tells no better
    result = await flown(Block(thing=(3.0, -6.2, 9.3)), log, [mixed, mixed])
    (count,) = [e.data for e in log.of("floor_count")]
    assert count.detail.floor_height_m == pytest.approx(1.5)
    assert log.of("height_check")[-1].data.confirmed
    assert result.outcome == "delivered"
