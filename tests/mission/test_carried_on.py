"""A mission may be cut after every step, or in the middle of one, and carried on by somebody else with the same end."""

import itertools
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import get_args

import pytest
from pydantic import ValidationError

from contracts.cameras import shipped_rig
from contracts.event_data import EventData
from contracts.geometry import Point3
from contracts.orchestrator import DeliveryResult, MissionSettings, OutcomeName, Phase
from contracts.sim import EpisodeQuestion, Verdict
from mission.advance import advance
from mission.mission import Mission, result_of
from mission.placement import OwnVehicle
from mission.policies import completed, policy_of
from mission.record import Pictures
from mission.state import MissionState, begin
from mission.step import MissionContext
from tests.mission.block import SIZE, Block, block_scene
from tests.mission.block_vehicle import BlockWorld
from tests.mission.box_world import RIG, block_placement, block_ports
from tests.mission.test_mission import BEHIND, REQUEST

DIAGRAM = (Path(__file__).parents[2] / "docs" / "mission.md").read_text(encoding="utf-8")
SEARCHES = [{"viewpoint": {"policy": "paper"}}, {"viewpoint": {"policy": "contour"}}, {"floors": "direct-count"}]


@dataclass
class Numbered:
    """A log that keeps the first event of each number, and refuses a gap."""

    told: list[tuple[Phase, str]] = field(default_factory=list)

    def write(self, number: int, phase: Phase, message: str, data: EventData, pictures: Pictures | None = None) -> None:
        assert number <= len(self.told) + 1
        if number == len(self.told) + 1:
            self.told.append((phase, message))
        else:
            assert self.told[number - 1] == (phase, message), "a step done again tells the same"


def context_of(world: BlockWorld, settings: MissionSettings, log: Numbered) -> MissionContext:
    """What a process that has never seen the mission brings along."""
    return MissionContext(block_ports(world), block_placement(world), settings, policy_of(settings.viewpoint), log)


def without_clocks(result: DeliveryResult) -> DeliveryResult:
    calls = {
        role: calls.model_copy(update={"seconds": 0.0, "latencies_s": ()}) for role, calls in result.model_calls.items()
    }
    return result.model_copy(update={"timings_s": {}, "model_calls": calls})


async def flown_through(block: Block, settings: MissionSettings) -> tuple[DeliveryResult, Numbered]:
    """In one go, by one process."""
    world, log = BlockWorld(block), Numbered()
    context = context_of(world, settings, log)
    result = await Mission(context.ports, context.placement, settings, log).fly(REQUEST, key="m")
    return result, log


async def states_of(block: Block, settings: MissionSettings) -> list[MissionState]:
    """Every state of a mission, from the first to the last."""
    context = context_of(BlockWorld(block), settings, Numbered())
    states = [begin(REQUEST, "m")]
    while not states[-1].over:
        states.append(await advance(states[-1], context))
    return states


@pytest.mark.parametrize("given", SEARCHES, ids=str)
async def test_every_step_by_another_process_and_done_twice_has_the_same_end(given: dict[str, object]) -> None:
    settings = completed(MissionSettings.model_validate(given))
    whole, told = await flown_through(BEHIND, settings)
    assert whole.outcome == "delivered"
    world, log = BlockWorld(BEHIND), Numbered()
    state = begin(REQUEST, "m")
    while not state.over:
        written = state.model_dump_json()
        died_before_writing = await advance(MissionState.model_validate_json(written), context_of(world, settings, log))
        state = await advance(MissionState.model_validate_json(written), context_of(world, settings, log))
        again = died_before_writing.model_dump(exclude={"calls", "seconds"})
        assert state.model_dump(exclude={"calls", "seconds"}) == again
    assert without_clocks(result_of(state, context_of(world, settings, log))) == without_clocks(whole)
    assert log.told == told.told
    assert len(world.vehicles) == 1


@pytest.mark.parametrize("given", SEARCHES, ids=str)
async def test_a_mission_cut_after_any_one_step_is_carried_on_to_the_same_end(given: dict[str, object]) -> None:
    settings = completed(MissionSettings.model_validate(given))
    whole, told = await flown_through(BEHIND, settings)
    for cut in range(1, len(await states_of(BEHIND, settings)) - 1, 4):
        world, log = BlockWorld(BEHIND), Numbered()
        first = context_of(world, settings, log)
        state = begin(REQUEST, "m")
        for _ in range(cut):
            state = await advance(state, first)
        second = context_of(world, settings, log)
        mission = Mission(second.ports, second.placement, settings, log)
        result = await mission.go_on(MissionState.model_validate_json(state.model_dump_json()))
        assert without_clocks(result) == without_clocks(whole), cut
        assert log.told == told.told, cut


async def test_a_step_is_at_most_one_flight_and_one_stop() -> None:
    for given in SEARCHES:
        states = await states_of(BEHIND, completed(MissionSettings.model_validate(given)))
        for before, after in itertools.pairwise(states):
            moves = (after.drone.moves if after.drone else 0) - (before.drone.moves if before.drone else 0)
            assert moves <= 1
            assert after.steps - before.steps <= 1


async def test_a_state_of_another_version_is_refused() -> None:
    with pytest.raises(ValidationError, match="version"):
        MissionState.model_validate(begin(REQUEST).model_dump() | {"version": 2})


async def test_without_a_judge_the_mission_ends_as_stopped_not_judged() -> None:
    world = BlockWorld(BEHIND)
    vehicle = await world.begin(EpisodeQuestion(scene=block_scene(BEHIND), rig=RIG, key="m"))
    result = await Mission(block_ports(world), OwnVehicle(vehicle), MissionSettings(), Numbered()).fly(REQUEST)
    assert result.outcome == "stopped_not_judged"
    assert "nobody judges" in result.message
    assert result.verdict is None
    assert vehicle.released


async def test_a_vehicle_on_the_ground_takes_off_first() -> None:
    world = BlockWorld(Block())
    vehicle = await world.begin(EpisodeQuestion(scene=block_scene(Block()), rig=RIG, key="m"))
    await vehicle.land()
    settings = MissionSettings(take_off_height_m=2.0)
    result = await Mission(block_ports(world), OwnVehicle(vehicle), settings, Numbered()).fly(REQUEST)
    assert result.outcome == "stopped_not_judged"


def test_the_diagram_has_every_stage_and_no_other() -> None:
    stages = set(MissionState.model_json_schema()["properties"]["stage"]["discriminator"]["mapping"])
    drawn = {name for edge in edges() for name in edge} - {"[*]"}
    assert drawn == stages


def test_every_way_a_mission_can_end_is_explained() -> None:
    table = DIAGRAM.split("## How a mission ends")[1].split("\n## ")[0]
    explained = {
        name for row in re.findall(r"^\| (`.*?) \|", table, re.MULTILINE) for name in re.findall(r"`(\w+)`", row)
    }
    assert explained == set(get_args(OutcomeName))


def edges() -> set[tuple[str, str]]:
    """What the diagram says leads to what."""
    return set(re.findall(r"^\s*(\S+) --> (\w+|\[\*\])", DIAGRAM, re.MULTILINE))


@pytest.mark.parametrize("given", SEARCHES, ids=str)
async def test_a_mission_goes_only_where_the_diagram_leads(given: dict[str, object]) -> None:
    for block in (BEHIND, Block(), Block(floors=2), Block(thing=(0.0, 500.0, 10.5))):
        short = {"max_exploration_steps": 3} if block.thing[1] > 100.0 else {}
        states = await states_of(block, completed(MissionSettings.model_validate(given | short)))
        for before, after in itertools.pairwise(states):
            assert (before.stage.at, after.stage.at) in edges()


class NamesNoGoal(BlockWorld):
    """A trial in a scene without a goal: it checks the stop, and judges nothing."""

    async def claim(self, vehicle: str, target: Point3 | None) -> Verdict:
        return (await super().claim(vehicle, target)).model_copy(
            update={"judged": False, "delivered": False, "right_window": None}
        )


async def test_in_a_scene_without_a_goal_nothing_says_delivered_unmarked() -> None:
    world, log = NamesNoGoal(BEHIND), Numbered()
    result = await Mission(block_ports(world), block_placement(world), MissionSettings(), log).fly(REQUEST)
    assert result.outcome == "stopped_not_judged"
    assert "names no goal" in result.message
    assert log.told[-1] == ("claim", result.message)


async def test_a_look_that_needs_turns_is_carried_on_between_them() -> None:
    settings, rig = completed(MissionSettings()), shipped_rig("front-wide").scaled_to(SIZE)

    def context(world: BlockWorld, log: Numbered) -> MissionContext:
        placement = block_placement(world, rig=rig)
        return MissionContext(block_ports(world), placement, settings, policy_of(settings.viewpoint), log)

    whole_world, told = BlockWorld(BEHIND), Numbered()
    at_once = context(whole_world, told)
    whole = await Mission(at_once.ports, at_once.placement, settings, told).fly(REQUEST, key="m")
    assert whole.outcome == "delivered"
    world, log, state, turning = BlockWorld(BEHIND), Numbered(), begin(REQUEST, "m"), 0
    while not state.over:
        written = state.model_dump_json()
        await advance(MissionState.model_validate_json(written), context(world, log))
        before, state = state, await advance(MissionState.model_validate_json(written), context(world, log))
        assert (before.stage.at, state.stage.at) in edges()
        turning += state.looking is not None
    assert without_clocks(result_of(state, context(world, log))) == without_clocks(whole)
    assert log.told == told.told
    assert turning > 0
