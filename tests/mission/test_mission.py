"""Missions in the block world: every way they can end, and what is counted on the way."""

import asyncio
import itertools
import math

import pytest

from contracts.events import Event, new_event
from contracts.geometry import Point3, Pose
from contracts.orchestrator import DeliveryResult, MissionSettings, SearchSettings
from contracts.scene import FreePlace, Scene, SceneObject
from contracts.vlm_gateway import ChooseDirectionAnswer, FindObjectAnswer, FloorCountAnswer, FloorCountQuestion
from mission.mission import Mission
from mission.ports import ModelUnreachable, ServiceUnreachable
from mission.wording import with_article
from tests.mission.block import Block, block_scene
from tests.mission.block_vehicle import BlockWorld
from tests.mission.box_world import WHO, BlockVision, block_placement, block_ports

BEHIND = Block(thing=(2.0, 6.2, 10.5), thing_normal=(0.0, 1.0))
REQUEST = "Please come to floor 4, the window with the green flower pot"
PAPER = SearchSettings(policy="paper")


class Events(list[Event]):
    """A log that keeps events in memory."""

    def write(self, number, phase, message, data, pictures=None):
        names = tuple(pictures() if pictures else ())
        self.append(new_event(data, number=number, time_s=0.0, phase=phase, message=message, pictures=names))

    def of(self, kind: str) -> list[Event]:
        return [e for e in self if e.kind == kind]


async def fly(
    world: BlockWorld,
    *,
    request: str = REQUEST,
    vision: BlockVision | None = None,
    log: Events | None = None,
    scene: Scene | None = None,
    **settings: object,
) -> DeliveryResult:
    chosen = MissionSettings.model_validate({"viewpoint": PAPER} | settings)
    events = log if log is not None else Events()
    return await Mission(block_ports(world, vision), block_placement(world, scene), chosen, events).fly(request)


async def test_a_window_on_the_first_facade_is_delivered_to() -> None:
    world = BlockWorld()
    result = await fly(world)
    assert result.outcome == "delivered"
    assert (result.floor, result.object) == (4, "green flower pot")
    assert result.verdict is not None
    assert result.verdict.distance_m < 3.0
    assert world.ended == ["e1"]


async def test_a_window_on_the_far_side_is_found_by_flying_clockwise_round_the_building() -> None:
    log = Events()
    result = await fly(BlockWorld(BEHIND), log=log)
    assert result.outcome == "delivered"
    bearings = [math.atan2(e.data.to.y, e.data.to.x) for e in log.of("move") if e.phase == "explore"]
    assert all(math.remainder(b - a, math.tau) < 0.05 for a, b in itertools.pairwise(bearings))


async def test_with_exact_counts_the_final_height_is_the_middle_of_the_floor() -> None:
    for floors, wanted in ((6, 4), (6, 1), (12, 11), (20, 14)):
        result = await fly(BlockWorld(Block(floors=floors)), request=f"floor {wanted}, the green flower pot",
                           max_exploration_steps=1)  # fmt: skip
        assert result.final_height_m == pytest.approx((wanted - 0.5) * 3.0, abs=0.05)


class SeesTheEdge(BlockVision):
    """Tells the rows of its floors, and counts those that lie `slack_m` beyond the picture's edge as well."""

    slack_m = 0.01

    async def floor_count(self, question: FloorCountQuestion) -> FloorCountAnswer:
        pose, block = self._pose("floor_count"), self.world.block
        away = block.y0 - pose.y
        middles = [(k + 0.5) * block.floor_height_m for k in reversed(range(block.floors))]
        rows = tuple(0.5 - (m - pose.z) / away / 2 for m in middles if abs(m - pose.z) < away + self.slack_m)
        shown = tuple(min(1.0, max(0.0, row)) for row in rows)
        return FloorCountAnswer(role="floors", floors=len(shown), rows=shown, **WHO)


class MissesTheEdge(SeesTheEdge):
    """Counts only what lies well inside the picture."""

    slack_m = -0.01


@pytest.mark.parametrize("vision", [SeesTheEdge, MissesTheEdge])
async def test_a_floor_whose_windows_lie_on_the_edge_of_two_pictures_is_counted_once(vision: type[BlockVision]) -> None:
    """From 8.25 m, the first picture ends at 16.5 m, in the middle of the sixth floor."""
    world = BlockWorld(Block(floors=14, start=Pose(x=0.0, y=-14.25, z=1.5, yaw=math.pi / 2)))
    log = Events()
    result = await fly(world, vision=vision(world), log=log, request="floor 9, the green flower pot",
                       max_exploration_steps=1)  # fmt: skip
    assert sum(e.data.floors_new for e in log.of("floor_count")) == 11
    assert result.final_height_m == pytest.approx(25.5, abs=0.7)


async def test_direct_count_finds_the_height_from_one_picture_of_the_whole_building() -> None:
    log = Events()
    result = await fly(BlockWorld(Block(floors=9)), log=log, floors="direct-count")
    assert result.outcome == "delivered"
    assert len(log.of("floor_count")) == 1
    assert result.final_height_m == pytest.approx(10.5, abs=0.2)


async def test_direct_count_comes_back_to_the_facade_over_what_stands_behind_the_way_it_went() -> None:
    log = Events()
    house = Block(x0=-8.0, x1=8.0, y0=-50.0, y1=-30.0, floors=3)
    tower = Block(floors=16, thing=(3.0, -6.2, 4.5), neighbour=house)
    result = await fly(BlockWorld(tower), log=log, request="floor 2, the green flower pot", floors="direct-count")
    assert min(e.data.to.y for e in log.of("move")) < house.y1  # it was above the house
    assert result.outcome == "delivered"


async def test_a_drone_that_rests_below_where_it_is_sent_flies_no_climb_twice() -> None:
    log = Events()
    result = await fly(BlockWorld(rests_below_m=0.4), log=log)
    assert result.outcome == "delivered"
    said = [event.message for event in log.of("move") if event.phase == "floors"]
    assert all(a != b or "as far as seen" in a for a, b in itertools.pairwise(said)), said


async def test_steps_count_stops_with_a_model_query_and_several_queries_at_one_stop_once() -> None:
    log = Events()
    result = await fly(BlockWorld(BEHIND), log=log)
    stops = {e.data.pose for e in log if e.kind in ("floor_count", "building_box", "look")}
    assert result.steps == len(stops)
    assert result.exploration_steps == len([e for e in log.of("look") if e.phase == "explore"])


async def test_the_result_says_where_each_stop_was_and_what_each_call_took() -> None:
    result = await fly(BlockWorld(BEHIND))
    assert len(result.stops) == result.steps
    assert {stop.phase for stop in result.stops} == {"floors", "explore", "approach"}
    assert all(abs(stop.pose.z - result.final_height_m) < 0.1 for stop in result.stops if stop.phase == "explore")
    assert len(result.model_calls["recognition"].latencies_s) == result.model_calls["recognition"].calls


async def test_one_observation_of_five_views_serves_each_exploration_step() -> None:
    log = Events()
    world = BlockWorld(BEHIND)
    vision = BlockVision(world)
    await fly(world, vision=vision, log=log)
    looks = log.of("look")
    assert all({"view", "view-90", "view-45", "view+45", "view+90"} <= set(e.pictures) for e in looks)
    assert all(view.depth in e.pictures for e in looks for view in e.data.views), "depth is kept beside its picture"
    assert vision.asked.count("find_object") == len(looks)


@pytest.mark.parametrize(
    ("request_text", "named"), [("the green flower pot", "no floor"), ("floor 4", "no object"), ("hello", "no floor")]
)
async def test_a_request_without_floor_or_object_ends_before_a_drone_is_started(request_text: str, named: str) -> None:
    world = BlockWorld()
    result = await fly(world, request=request_text)
    assert result.outcome == "request_incomplete"
    assert named in result.message
    assert not world.live
    assert not world.ended


async def test_a_floor_that_the_building_has_not_got_is_not_found() -> None:
    world = BlockWorld(Block(floors=6))
    result = await fly(world, request="floor 9, the green flower pot")
    assert result.outcome == "floor_not_found"
    assert "6 floors" in result.message
    assert world.ended == ["e1"]


async def test_an_object_that_is_nowhere_ends_after_the_last_exploration_step() -> None:
    result = await fly(BlockWorld(Block(thing=(0.0, 500.0, 10.5))), max_exploration_steps=4)
    assert (result.outcome, result.exploration_steps) == ("object_not_found", 4)


async def test_a_scene_that_the_world_refuses_ends_with_the_worlds_own_words() -> None:
    world = BlockWorld()
    unicorn = SceneObject(id="u", kind="unicorn", colour="white", place=FreePlace(position=Point3(x=0, y=0, z=0)))
    scene = block_scene(world.block).model_copy(update={"objects": (unicorn,)})
    result = await fly(world, scene=scene)
    assert result.outcome == "failed"
    assert "no class unicorn" in result.message


async def test_a_model_that_cannot_be_reached_ends_the_mission_and_is_counted_apart() -> None:
    world = BlockWorld()
    vision = BlockVision(world, {"floor_count": [ModelUnreachable("gateway: model_timeout")]})
    result = await fly(world, vision=vision)
    assert result.outcome == "model_unreachable"
    calls = result.model_calls["floors"]
    assert (calls.calls, calls.unreachable, calls.unreadable, calls.refused) == (1, 1, 0, 0)
    assert world.ended == ["e1"]


async def test_a_service_that_cannot_be_reached_is_told_from_a_model() -> None:
    world = BlockWorld()
    vision = BlockVision(world, {"find_object": [ServiceUnreachable("vlm_gateway: nobody there")]})
    assert (await fly(world, vision=vision)).outcome == "service_unreachable"


async def test_a_thing_that_the_model_has_never_learnt_is_told_before_take_off() -> None:
    world = BlockWorld()
    thing = (await fly(world)).object
    assert thing is not None
    world = BlockWorld()
    vision = BlockVision(world, unknown=frozenset({thing}))
    result = await fly(world, vision=vision)
    assert result.outcome == "object_unknown"
    assert f"did not take off: it has never learnt to recognise {with_article(thing)}" in result.message
    assert "name another thing at the window" in result.message
    assert (result.path_m, result.steps, vision.asked, world.ended) == (0.0, 0, [], [])


async def test_a_model_that_there_is_not_ends_the_mission_before_take_off() -> None:
    world = BlockWorld()
    vision = BlockVision(world, {"preflight": [ModelUnreachable("vlm_gateway: no model 'qwen'; there is embedded")]})
    result = await fly(world, vision=vision)
    assert (result.outcome, result.path_m, vision.asked) == ("model_unreachable", 0.0, [])
    assert "there is embedded" in result.message


async def test_an_unreadable_floor_count_is_asked_again_from_a_different_look_and_then_given_up() -> None:
    useless = FloorCountAnswer(role="floors", **(WHO | {"outcome": "unreadable"}))
    world = BlockWorld()
    log = Events()
    once = await fly(world, vision=BlockVision(world, {"floor_count": [useless]}), log=log)
    assert once.outcome == "delivered"
    assert once.model_calls["floors"].unreadable == 1
    yaws = [e.data.pose.yaw for e in log.of("floor_count")]
    assert yaws[0] != yaws[1]
    always = await fly(world, vision=BlockVision(world, {"floor_count": [useless] * 9}), max_model_failures=2)
    assert always.outcome == "answer_unreadable"
    assert always.model_calls["floors"].unreadable == 3


async def test_a_model_that_counts_no_floors_is_named_with_its_own_words_at_the_end() -> None:
    refusal = FloorCountAnswer(role="floors", **(WHO | {"outcome": "refused", "text": "colours have\nno floors"}))
    world = BlockWorld()
    end = await fly(world, vision=BlockVision(world, {"floor_count": [refusal] * 9}), max_model_failures=2)
    assert end.message.startswith(
        "the floor count was refused 3 times by geometry, in its words 'colours have no floors'"
    )


async def test_a_recognition_model_that_only_refuses_is_never_scored_as_no() -> None:
    refusal = FindObjectAnswer(role="recognition", **(WHO | {"outcome": "refused"}))
    world = BlockWorld()
    result = await fly(world, vision=BlockVision(world, {"find_object": [refusal] * 9}), max_model_failures=2)
    assert result.outcome == "answer_unreadable"
    assert result.model_calls["recognition"].refused == 3


async def test_an_unreadable_choice_falls_back_to_the_centre_and_is_counted() -> None:
    useless = ChooseDirectionAnswer(role="choice", **(WHO | {"outcome": "unreadable"}))
    world = BlockWorld(BEHIND)
    log = Events()
    result = await fly(world, vision=BlockVision(world, {"choose_direction": [useless]}), log=log)
    assert result.outcome == "delivered"
    assert result.model_calls["choice"].unreadable == 1
    assert log.of("direction")[0].data.label == "c"
    assert "unreadable" in log.of("direction")[0].message


async def test_a_choice_that_was_not_offered_is_not_flown() -> None:
    world = BlockWorld(BEHIND)
    log = Events()
    odd = ChooseDirectionAnswer(role="choice", label="e", **WHO)
    await fly(world, vision=BlockVision(world, {"choose_direction": [odd]}), log=log)
    first = log.of("direction")[0].data
    assert first.label in first.offered


async def test_the_centre_ablation_asks_no_choice_model() -> None:
    world = BlockWorld(BEHIND)
    result = await fly(world, viewpoint=SearchSettings(policy="paper", choice="centre"))
    assert "choice" not in result.model_calls
    assert result.outcome == "delivered"


async def test_the_default_viewpoint_always_takes_the_right_view() -> None:
    log = Events()
    await fly(BlockWorld(BEHIND), log=log, viewpoint=SearchSettings(policy="default"), max_exploration_steps=4)
    assert {e.data.heading_deg for e in log.of("direction")} == {90}


async def test_only_ways_over_the_threshold_are_offered_and_without_one_the_drone_turns_30_degrees_left() -> None:
    far = SearchSettings(policy="paper", min_move_m=11.0)
    log = Events()
    await fly(BlockWorld(BEHIND), log=log, viewpoint=far, max_exploration_steps=3)
    turns = [e for e in log.of("turn") if e.phase == "explore"]
    assert len(turns) == 2
    for turn in turns:
        left = math.remainder(turn.data.to.yaw - turn.data.start.yaw, math.tau)
        assert left == pytest.approx(math.radians(30), abs=1e-6)


async def test_cancelling_anywhere_gives_a_result_and_the_episode_back() -> None:
    for after in (0.0, 0.05, 0.2):
        world = BlockWorld(BEHIND, slow_s=0.03)
        task = asyncio.create_task(fly(world))
        await asyncio.sleep(after)
        task.cancel()
        result = await task
        assert result.outcome == "cancelled"
        assert not world.live
