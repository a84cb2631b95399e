"""Missions that search by the contour explorer, in the block world."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from contracts.orchestrator import DeliveryQuestion, DeliveryResult, MissionSettings, SearchSettings
from contracts.vlm_gateway import FindObjectAnswer, FindObjectQuestion, Match
from mission.clients import Simulated
from mission.mission import Mission
from orchestrator.delivery import Order, Run
from orchestrator.summary import GOOD
from tests.mission.block import Block, StereoBlock, block_scene
from tests.mission.block_vehicle import BlockWorld
from tests.mission.box_world import WHO, BlockVision, block_placement, block_ports
from tests.mission.test_mission import BEHIND, REQUEST, Events

CONTOUR = SearchSettings(policy="contour")


async def fly(world: BlockWorld, log: Events, vision: BlockVision | None = None, **settings: object) -> DeliveryResult:
    chosen = MissionSettings(viewpoint=CONTOUR, **settings)
    return await Mission(block_ports(world, vision), block_placement(world), chosen, log).fly(REQUEST)


async def test_a_window_on_the_far_side_is_found_by_the_contour_explorer() -> None:
    log = Events()
    result = await fly(BlockWorld(BEHIND), log)
    assert result.outcome == "delivered"
    assert result.exploration_steps <= 10
    assert not log.of("direction")
    assert "choice" not in result.model_calls


async def test_a_thing_seen_on_another_floor_is_told_to_the_customer() -> None:
    result = await fly(BlockWorld(Block(thing=(3.0, -6.2, 4.5))), Events(), max_exploration_steps=2)
    assert result.outcome == "object_not_found"
    assert "seen on another floor, about 4 m high" in result.message


@pytest.mark.parametrize(("range_m", "noise_per_m"), [(200.0, 0.0), (20.0, 0.0013), (10.0, 0.003)])
async def test_the_far_side_is_found_with_a_sensor_to_which_sky_and_distance_are_invalid(
    range_m: float, noise_per_m: float
) -> None:
    start = BEHIND.start.model_copy(update={"y": -12.0})
    block = StereoBlock(
        thing=BEHIND.thing, thing_normal=(0.0, 1.0), start=start, range_m=range_m, noise_per_m=noise_per_m
    )
    result = await fly(BlockWorld(block), Events())
    assert result.outcome == "delivered"


async def test_every_step_of_the_contour_explorer_leaves_what_a_viewer_can_draw() -> None:
    log = Events()
    await fly(BlockWorld(BEHIND), log)
    steps = [e.data for e in log.of("search")]
    assert len(steps) > 1
    assert all(s.drawing.inspected for s in steps)
    assert any(s.drawing.expected for s in steps)
    assert all(0.0 < s.inspected_share < 1.0 for s in steps)
    inspected = [len(s.drawing.inspected) for s in steps]
    assert inspected == sorted(inspected)


async def test_a_search_that_has_seen_it_all_ends_with_the_share_of_the_facade_inspected() -> None:
    log = Events()
    world = BlockWorld(Block())
    nothing = FindObjectAnswer(role="recognition", found=False, matches=(), **WHO)
    result = await fly(world, log, BlockVision(world, says={"find_object": [nothing] * 40}))
    assert result.outcome == "object_not_found"
    last = log.of("search")[-1].data
    assert last.details["status"] == "done"
    assert last.inspected_share > 0.98
    assert f"{100 * last.inspected_share:.0f} % of the facade" in result.message
    assert result.exploration_steps < 30


async def test_the_summary_shows_the_facade_that_was_inspected(tmp_path: Path) -> None:
    settings = MissionSettings(viewpoint=CONTOUR)
    question = DeliveryQuestion(request=REQUEST, scene=block_scene(BEHIND), settings=settings)
    run = Run(Order(question), tmp_path)
    await run.fly(Simulated(block_ports(world := BlockWorld(BEHIND)), world))
    picture = cv2.imread(str(run.record.folder / "summary.png"))
    green = (picture == np.array(GOOD[::-1])).all(axis=2)
    assert green[:, :880].sum() > 1500  # the plan's half; the facts beside it are written in the same green


async def test_what_did_not_stand_up_seen_slantwise_is_tried_again_from_another_side() -> None:
    log = Events()
    world = BlockWorld(BEHIND)
    vision = OnceShy(world)
    result = await fly(world, log, vision)
    assert log.of("lost")
    assert result.outcome == "delivered"


async def test_the_same_thing_on_a_neighbour_s_wall_is_passed_by() -> None:
    log = Events()
    twin = Block(x0=21.0, x1=29.0, y0=-10.0, y1=10.0, thing=(20.8, -4.0, 10.5))
    world = BlockWorld(replace(BEHIND, neighbour=twin))
    result = await fly(world, log, TwinVision(world))
    told = [s for e in log.of("look") for s in e.data.sightings]
    assert "not on the building searched" in {s.rejected for s in told}
    assert all(s.place.x < 15.0 for s in told if s.accepted)
    assert result.outcome == "delivered"


class TwinVision(BlockVision):
    """Sees what hangs on the neighbour's wall as well, and better."""

    async def find_object(self, question: FindObjectQuestion) -> FindObjectAnswer:
        answer = await super().find_object(question)
        pose, block = self.world.pose, self.world.block
        assert block.neighbour is not None
        twins = {v.camera.name: block.sees(pose, v.camera, block.neighbour.thing) for v in question.views}
        matches = tuple(Match(camera=name, box=b, confidence=0.95) for name, b in twins.items() if b) + answer.matches
        return FindObjectAnswer(role="recognition", found=bool(matches), matches=matches, **WHO)


class OnceShy(BlockVision):
    """Does not see the thing again after having seen it for the first time."""

    def __init__(self, world: BlockWorld) -> None:
        super().__init__(world)
        self._sightings = 0

    async def find_object(self, question: FindObjectQuestion) -> FindObjectAnswer:
        answer = await super().find_object(question)
        self._sightings += answer.found
        shy = answer.found and self._sightings == 2
        return FindObjectAnswer(role="recognition", found=False, matches=(), **WHO) if shy else answer
