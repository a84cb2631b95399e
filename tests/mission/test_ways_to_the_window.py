"""Sightings to which no way leads, or not at once: from elsewhere, from another side, into a wall, into glass."""

import math
from collections.abc import Iterable
from itertools import chain, cycle, repeat

import pytest

from contracts.depth_assist import ApproachAnswer, ApproachQuestion, ExploreAnswer, ExploreQuestion
from contracts.geometry import Box, Point2, Point3, Pose
from contracts.orchestrator import DeliveryResult, MissionSettings, SearchSettings
from contracts.vlm_gateway import FindObjectAnswer, Match
from mission.mission import Mission
from mission.ports import Ports
from tests.mission.block import Block
from tests.mission.block_vehicle import BlockWorld
from tests.mission.box_world import WHO, BlockVision, LocalDepthAssist, block_placement, block_ports
from tests.mission.test_mission import BEHIND, PAPER, REQUEST, Events, fly


async def test_a_match_on_another_floor_or_without_depth_is_rejected() -> None:
    world = BlockWorld(Block(thing=(0.0, 500.0, 10.5)))
    low = Box(x_min=0.45, y_min=0.85, x_max=0.55, y_max=0.95)
    sky = Box(x_min=0.45, y_min=0.01, x_max=0.55, y_max=0.05)
    matches = (Match(camera="front", box=low), Match(camera="left", box=sky))
    said = FindObjectAnswer(role="recognition", found=True, matches=matches, **WHO)
    log = Events()
    result = await fly(world, vision=BlockVision(world, {"find_object": [said]}), log=log, max_exploration_steps=1)
    assert result.outcome == "object_not_found"
    reasons = [s.rejected for s in log.of("look")[0].data.sightings]
    assert "not on the floor" in reasons[0]
    assert reasons[1] == "no depth in its box"


async def test_a_sighting_that_does_not_stand_up_is_dismissed_and_the_search_goes_on() -> None:
    world = BlockWorld(BEHIND)
    box = Box(x_min=0.4, y_min=0.45, x_max=0.5, y_max=0.55)
    phantom = FindObjectAnswer(role="recognition", found=True, matches=(Match(camera="front", box=box),), **WHO)
    log = Events()
    result = await fly(world, vision=BlockVision(world, {"find_object": [phantom]}), log=log)
    assert log.of("lost")
    assert result.outcome == "delivered"


class BlockedAtFirst(LocalDepthAssist):
    """A depth assistant that sees no way in for the first `times` asked."""

    def __init__(self, times: int) -> None:
        self._left = times

    async def approach(self, question: ApproachQuestion) -> ApproachAnswer:
        self._left -= 1
        if self._left >= 0:
            return ApproachAnswer(status="blocked")
        return await super().approach(question)


@pytest.mark.parametrize(("times", "outcome"), [(1, "delivered"), (99, "blocked")])
async def test_a_sighting_whose_way_is_not_free_is_tried_again_from_elsewhere(times: int, outcome: str) -> None:
    world = BlockWorld(BEHIND)
    usual = block_ports(world)
    log = Events()
    ports = Ports(usual.parser, usual.vision, BlockedAtFirst(times))
    settings = MissionSettings(viewpoint=PAPER, max_exploration_steps=12)
    result = await Mission(ports, block_placement(world), settings, log).fly(REQUEST)
    assert result.outcome == outcome
    tried = [e.data.pose for e in log.of("look") if e.data.accepted]
    assert tried[0] != tried[1]


class OnlyAsideAtFirst(LocalDepthAssist):
    """A depth assistant that sees no way in for the first `times` asked, but one to the thing's other side."""

    def __init__(self, times: int) -> None:
        self._left = times

    async def approach(self, question: ApproachQuestion) -> ApproachAnswer:
        self._left -= 1
        answer = await super().approach(question)
        if self._left >= 0:
            place = Point3(x=question.pose.x + 2.0, y=question.pose.y, z=question.pose.z)
            return answer.model_copy(update={"status": "blocked", "path": (), "aside": (place,), "reached": False})
        return answer


@pytest.mark.parametrize(("times", "lost"), [(1, 0), (2, 0), (3, 1)])
async def test_what_no_way_leads_to_is_looked_at_from_another_side_before_the_search_goes_on(
    times: int, lost: int
) -> None:
    world, log = BlockWorld(), Events()
    result = await _flown_with(OnlyAsideAtFirst(times), world, log)
    assert result.outcome == "delivered"
    assert sum("another side" in e.message for e in log.of("move")) == min(times, 2)
    assert [e.data.blocked for e in log.of("lost")][:1] == [True] * lost


class ThroughTheWall(LocalDepthAssist):
    """A depth assistant that leads into the building."""

    async def approach(self, question: ApproachQuestion) -> ApproachAnswer:
        inside = Point3(x=0.0, y=0.0, z=question.pose.z)
        return (await super().approach(question)).model_copy(update={"path": (inside,), "status": "clear"})


async def test_what_leads_into_a_wall_is_refused_by_the_flight_guard() -> None:
    world, log = BlockWorld(), Events()
    result = await _flown_with(ThroughTheWall(), world, log)
    assert result.outcome == "blocked"
    assert {e.data.reason for e in log.of("refused")} == {"clearance"}
    assert not world.vehicles["e1"].collided
    assert world.ended == ["e1"]


class IntoTheWall(LocalDepthAssist):
    """An explorer that takes the facade for open, until the drone is near it."""

    async def explore(self, question: ExploreQuestion) -> ExploreAnswer:
        answer = await super().explore(question)
        if question.pose.y > -12.0:
            return answer
        inside = Point2(x=question.pose.x, y=-5.0)
        return answer.model_copy(update={"status": "move", "stop": inside, "distance_m": -5.0 - question.pose.y})


async def test_after_a_refusal_the_search_goes_half_of_a_way_and_looks_again() -> None:
    world, log = BlockWorld(BEHIND), Events()
    result = await _flown_with(IntoTheWall(), world, log, SearchSettings(policy="contour"))
    refused = log.of("refused")
    halves = [e for e in log.of("move") if "50% of the way" in e.message]
    assert [e.data.reason for e in refused] == ["clearance"]
    assert len(halves) == 1
    assert halves[0].data.path[0].y == pytest.approx((halves[0].data.start.y - 5.0) / 2.0, abs=0.01)
    assert result.outcome == "delivered"


class GlassBlock(Block):
    """A pane stands before the facade that no depth camera sees."""

    def distance(self, x: float, y: float, z: float) -> float:
        return min(super().distance(x, y, z), math.hypot(abs(y + 9.0), max(0.0, abs(x) - 8.0)))


async def test_a_collision_ends_the_mission_at_once() -> None:
    world = BlockWorld(GlassBlock())
    log = Events()
    result = await fly(world, log=log)
    assert result.outcome == "collision"
    assert "house" in result.message
    assert log[-1].data.hit == "house"
    assert world.ended == ["e1"]


class StopsAside(LocalDepthAssist):
    """A depth assistant that takes the stop to be so far aside, metres, and the facade to be turned so far, radians,
    each time that it sees a way up to the stop; once it runs out of mistakes it is right."""

    def __init__(self, mistakes: Iterable[tuple[float, float]]) -> None:
        self._mistakes = iter(mistakes)

    async def approach(self, question: ApproachQuestion) -> ApproachAnswer:
        answer = await super().approach(question)
        if not answer.reached or answer.stop is None or answer.facing_yaw is None:
            return answer
        aside_m, turned_rad = next(self._mistakes, (0.0, 0.0))
        if aside_m == 0.0:
            return answer
        stop = answer.stop.model_copy(update={"x": answer.stop.x + aside_m})
        changed = {"stop": stop, "path": (stop,), "facing_yaw": answer.facing_yaw + turned_rad}
        return answer.model_copy(update=changed)


async def _flown_with(
    depth: LocalDepthAssist, world: BlockWorld, log: Events, search: SearchSettings = PAPER
) -> DeliveryResult:
    usual = block_ports(world)
    ports = Ports(usual.parser, usual.vision, depth)
    return await Mission(ports, block_placement(world), MissionSettings(viewpoint=search), log).fly(REQUEST)


def _legs(log: Events) -> int:
    return sum("of the approach" in e.message for e in log.of("move"))


@pytest.mark.parametrize(("aside_m", "looks"), [(0.0, 0), (0.5, 0), (1.1, 1)])
async def test_a_stop_that_turns_out_to_be_far_aside_is_flown_to_and_looked_from_before_the_claim(
    aside_m: float, looks: int
) -> None:
    world, log = BlockWorld(), Events()
    result = await _flown_with(StopsAside([(aside_m, 0.0)]), world, log)
    assert result.outcome == "delivered"
    assert result.pose is not None
    assert result.pose.x == pytest.approx(world.block.thing[0], abs=0.2)
    assert _legs(log) == (await _legs_without_a_mistake()) + looks


async def test_a_facade_that_seems_to_stand_otherwise_from_the_stop_moves_no_stop() -> None:
    world = BlockWorld()
    railing_for_facade = StopsAside(chain([(0.0, 0.0)], repeat((1.1, 0.4))))
    result = await _flown_with(railing_for_facade, world, Events())
    assert result.outcome == "delivered"
    assert result.pose is not None
    assert result.pose.x == pytest.approx(world.block.thing[0], abs=0.2)


async def test_a_drone_does_not_fly_to_and_fro_between_stops_that_never_agree() -> None:
    log = Events()
    result = await _flown_with(StopsAside(cycle([(0.6, 0.0), (-0.6, 0.0)])), BlockWorld(), log)
    assert result.verdict is not None
    assert _legs(log) == (await _legs_without_a_mistake()) + 1


async def _legs_without_a_mistake() -> int:
    world = BlockWorld()
    log = Events()
    await fly(world, log=log)
    return _legs(log)


@pytest.mark.parametrize(("x", "aslant"), [(6.5, True), (1.0, False)])
async def test_what_was_seen_aslant_is_looked_at_from_straight_before_it_ahead_of_the_last_leg(
    x: float, aslant: bool
) -> None:
    start = Pose(x=-3.0, y=-12.0, z=1.5, yaw=math.pi / 2)
    log = Events()
    result = await fly(BlockWorld(Block(thing=(x, -6.2, 10.5), start=start)), log=log)
    assert result.outcome == "delivered"
    looked = [e.data.pose for e in log.of("look")]
    before = [pose for pose in looked if abs(pose.x - x) < 0.3 and pose.y == pytest.approx(-9.4, abs=0.2)]
    assert len(before) == aslant
