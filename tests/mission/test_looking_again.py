"""When a sighting is believed: candidates are looked at from nearer, claims at first sight are not."""

import math
from dataclasses import dataclass, field

import pytest

from contracts.cameras import Camera
from contracts.depth_assist import ApproachAnswer, ApproachQuestion
from contracts.geometry import Point3, Pose
from contracts.orchestrator import DeliveryResult, MissionSettings, SearchSettings, SightingSettings
from contracts.vlm_gateway import FindObjectAnswer, FindObjectQuestion, Match
from mission.mission import Mission
from tests.mission.block import Block
from tests.mission.block_vehicle import BlockWorld
from tests.mission.box_world import WHO, BlockVision, LocalDepthAssist, block_placement, block_ports
from tests.mission.test_mission import BEHIND, REQUEST, Events

CLAIM = 0.8
IMPOSTOR = (-3.0, -6.2, 10.5)
PAPER = SearchSettings(policy="paper")
"""On the facade that the drone faces at first; the thing itself hangs on the far side."""


@dataclass
class DoubtfulVision(BlockVision):
    """Sees the thing, and whatever else is taken for it, with a confidence that depends on the distance only."""

    thing: dict[float, float] = field(default_factory=dict)
    impostor: dict[float, float] = field(default_factory=dict)
    seen_from: list[Pose] = field(default_factory=list)

    async def find_object(self, question: FindObjectQuestion) -> FindObjectAnswer:
        pose = self._pose("find_object")
        matches = []
        for place, confidences in ((self.world.block.thing, self.thing), (IMPOSTOR, self.impostor)):
            matches += [m for v in question.views if (m := self._match(pose, v.camera, place, confidences))]
            if place == IMPOSTOR and any(m.confidence for m in matches if confidences):
                self.seen_from.append(pose)
        best_first = tuple(sorted(matches, key=lambda m: -m.confidence))
        found = any(m.confidence >= CLAIM for m in matches)
        return FindObjectAnswer(role="recognition", found=found, matches=best_first, claim_confidence=CLAIM, **WHO)

    def _match(
        self, pose: Pose, camera: Camera, place: tuple[float, float, float], confidences: dict[float, float]
    ) -> Match | None:
        block = self.world.block
        away = math.dist(place, (pose.x, pose.y, pose.z))
        confidence = next((c for within, c in sorted(confidences.items()) if away <= within), 0.0)
        box = Block(thing=place, floors=block.floors).sees(pose, camera)
        return Match(camera=camera.name, box=box, confidence=confidence) if box and confidence else None


async def fly(
    thing: dict[float, float],
    impostor: dict[float, float] | None = None,
    depth: LocalDepthAssist | None = None,
    block: Block = BEHIND,
    **sightings: object,
) -> tuple[DeliveryResult, Events, DoubtfulVision]:
    world = BlockWorld(block)
    vision = DoubtfulVision(world, thing=thing, impostor=impostor or {})
    settings = MissionSettings(viewpoint=PAPER, sightings=SightingSettings.model_validate(sightings))
    log = Events()
    mission = Mission(block_ports(world, vision, depth), block_placement(world), settings, log)
    return await mission.fly(REQUEST), log, vision


SURE, MIDDLING = {99.0: 0.95}, {99.0: 0.5}


async def test_a_middling_sighting_that_is_sure_from_near_is_delivered_to() -> None:
    result, log, _ = await fly({6.0: 0.95, 99.0: 0.4})
    assert result.outcome == "delivered"
    assert not log.of("lost")


async def test_a_middling_sighting_that_stays_middling_is_dropped_and_the_search_goes_on() -> None:
    result, log, _ = await fly(SURE, MIDDLING)
    assert result.outcome == "delivered"
    assert len(log.of("lost")) == 1
    assert "sure" in log.of("lost")[0].message


async def test_a_middling_sighting_that_is_nothing_from_near_is_dropped() -> None:
    result, log, _ = await fly(SURE, {6.0: 0.0, 99.0: 0.7})
    assert result.outcome == "delivered"
    assert "not seen again" in log.of("lost")[0].message


class RoundACorner(LocalDepthAssist):
    """A depth assistant whose ways all have a corner, a metre above their straight middle."""

    async def approach(self, question: ApproachQuestion) -> ApproachAnswer:
        answer = await super().approach(question)
        if not answer.path:
            return answer
        here, end = question.pose, answer.path[-1]
        corner = Point3(x=(here.x + end.x) / 2, y=(here.y + end.y) / 2, z=here.z + 1.0)
        return answer.model_copy(update={"path": (corner, end)})


async def test_the_way_back_from_a_dropped_candidate_goes_round_every_corner_of_the_way_there() -> None:
    result, log, _ = await fly(SURE, {6.0: 0.0, 99.0: 0.7}, RoundACorner())
    assert result.outcome == "delivered"
    moves = log.of("move")
    back = next(i for i, move in enumerate(moves) if "back to" in move.message)
    legs = [move for move in moves[:back] if "of the approach" in move.message]
    there = [point for leg in legs for point in leg.data.path]
    begun = legs[0].data.start
    start = Point3(x=begun.x, y=begun.y, z=begun.z)
    assert moves[back].data.path == (*reversed(there[:-1]), start)
    assert any(point.z != start.z for point in moves[back].data.path)


async def test_where_two_windows_show_the_thing_the_customer_is_told_so() -> None:
    result, log, _ = await fly(SURE, SURE, block=Block())
    assert result.outcome == "request_incomplete"
    assert result.verdict is None
    assert "two windows on floor 4 have a green flower pot, 7 m apart" in result.message
    assert not log.of("verdict")


async def test_a_second_thing_that_is_not_sure_makes_nothing_ambiguous() -> None:
    result, _, _ = await fly(SURE, MIDDLING, block=Block())
    assert result.outcome == "delivered"


async def test_at_first_sight_a_second_window_is_not_asked_about() -> None:
    result, _, _ = await fly(SURE, SURE, block=Block(), policy="claim-at-first-sight")
    assert result.outcome in ("delivered", "wrong_window")


@pytest.mark.parametrize(("thing", "outcome"), [(0.95, "delivered"), (0.84, "request_incomplete")])
async def test_a_thing_that_fades_from_near_gives_way_to_a_surer_one_beside_it(thing: float, outcome: str) -> None:
    result, log, _ = await fly({8.0: thing}, {4.0: 0.0, 30.0: 0.85}, block=Block())
    assert result.outcome == outcome
    assert ("a surer one" in str([e.message for e in log.of("lost")])) == (outcome == "delivered")


async def test_a_dropped_candidate_is_not_flown_to_twice() -> None:
    nowhere = {0.1: 1.0}
    result, log, _ = await fly(nowhere, MIDDLING)
    assert result.outcome == "object_not_found"
    assert len(log.of("lost")) == 1
    assert any(s.rejected == "looked at from near before" for e in log.of("look") for s in e.data.sightings)


async def test_what_is_below_a_candidate_is_never_flown_to() -> None:
    _, log, _ = await fly({0.1: 1.0}, {99.0: 0.25})
    assert not log.of("lost")
    _, log, _ = await fly({0.1: 1.0}, {99.0: 0.25}, candidate_confidence=0.2)
    assert log.of("lost")


@pytest.mark.parametrize(("confidence", "outcome"), [(0.85, "wrong_window"), (0.5, "delivered")])
async def test_claiming_at_first_sight_believes_what_may_be_claimed_and_no_candidate(
    confidence: float, outcome: str
) -> None:
    result, log, _ = await fly(SURE, {6.0: 0.0, 99.0: confidence}, policy="claim-at-first-sight")
    assert result.outcome == outcome
    assert not log.of("lost")


async def test_at_first_sight_means_that_no_look_on_the_way_can_drop_it() -> None:
    fading = {8.0: 0.0, 99.0: 0.9}
    again, log, _ = await fly(fading)
    first, _, _ = await fly(fading, policy="claim-at-first-sight")
    assert again.verdict is None
    assert log.of("lost")
    assert first.verdict is not None


async def test_the_settings_may_ask_for_more_than_the_model_does() -> None:
    careful, log, _ = await fly({99.0: 0.85}, claim_confidence=0.9)
    assert careful.outcome == "object_not_found"
    assert log.of("lost")
    easy, _, _ = await fly({99.0: 0.5}, claim_confidence=0.4)
    assert easy.outcome == "delivered"


async def test_every_look_counts_as_a_step() -> None:
    result, log, _ = await fly(SURE, MIDDLING)
    looks = [e for e in log.of("look") if e.phase == "approach"]
    assert looks
    assert len([stop for stop in result.stops if stop.phase == "approach"]) == len(looks)
    assert result.steps == len(result.stops)


async def test_a_sure_look_from_afar_confirms_nothing_that_is_doubtful_from_near() -> None:
    result, log, _ = await fly(SURE, impostor={6.0: 0.6, 99.0: 0.99})
    assert result.outcome == "delivered"
    assert any("0.60 sure" in e.message for e in log.of("lost"))
    assert math.dist((result.pose.x, result.pose.y), IMPOSTOR[:2]) > 5.0 if result.pose else False


async def test_what_two_looks_from_one_place_leave_in_doubt_is_looked_at_from_straight_before_it() -> None:
    near = Block(thing=IMPOSTOR, start=Pose(x=-1.0, y=-11.0, z=1.5, yaw=math.pi / 2))
    result, log, _ = await fly({3.4: 0.95, 99.0: 0.5}, block=near)
    assert result.outcome == "delivered"
    assert not log.of("lost")
