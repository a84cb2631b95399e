"""Cameras that don't see all round: the drone turns, and what it saw on the way is one look."""

import math

import numpy as np
import pytest

from contracts.cameras import MountingOffset, Rig, pinhole_camera, shipped_rig
from contracts.geometry import Pose
from contracts.orchestrator import DeliveryResult, MissionSettings
from mission.advance import advance
from mission.looks import camera_as_of, navigation_camera, turns_needed
from mission.mission import Mission, result_of
from mission.policies import completed, policy_of
from mission.state import MissionState, begin
from mission.step import MissionContext
from navigation import camera as mathematics
from tests.mission.block import SIZE, Block
from tests.mission.box_world import BlockVision, BlockWorld, block_placement, block_ports
from tests.mission.test_mission import REQUEST, Events

AROUND_THE_CORNER = Block(thing=(8.2, 0.0, 10.5), thing_normal=(1.0, 0.0))
WIDE = shipped_rig("front-wide").scaled_to(SIZE)


def needed(rig: Rig, reach_deg: float = 135.0) -> tuple[float, ...]:
    return turns_needed([navigation_camera(camera) for camera in rig.cameras], reach_deg)


def single(fov_deg: float, heading_deg: float = 0.0, pitch_deg: float = 0.0) -> Rig:
    camera = pinhole_camera("one", 120, 90, horizontal_fov_deg=fov_deg, heading_deg=heading_deg, pitch_deg=pitch_deg)
    return Rig(name="one", cameras=(camera,))


@pytest.mark.parametrize("name", ["paper-five", "paper-five-up"])
def test_five_cameras_see_all_round_without_turning(name: str) -> None:
    assert needed(shipped_rig(name)) == ()


def test_one_wide_camera_looks_to_the_left_to_the_right_and_ahead_again() -> None:
    assert needed(shipped_rig("front-wide")) == (-90.0, 90.0, 0.0)
    assert needed(shipped_rig("front-wide"), 30.0) == ()


@pytest.mark.parametrize("fov_deg", [35.0, 60.0, 84.0])
def test_whatever_the_lens_the_turns_leave_no_gap_and_end_ahead(fov_deg: float) -> None:
    turns = needed(single(fov_deg))
    assert turns[-1] == 0.0
    seen = {b for turn in turns for b in range(math.ceil(turn - fov_deg / 2), math.floor(turn + fov_deg / 2) + 1)}
    assert set(range(-135, 136)) <= seen


def test_a_camera_that_looks_up_sees_nothing_to_the_side() -> None:
    assert needed(single(90.0, pitch_deg=90.0)) == ()  # it would see no more after any turn


def test_a_view_after_a_turn_is_that_of_a_camera_with_another_heading() -> None:
    """A pixel's place is the same, whether the drone had turned or the camera is mounted that way."""
    offset = MountingOffset(forward_m=0.4, right_m=-0.2, up_m=0.1)
    camera = pinhole_camera("front", 80, 60, horizontal_fov_deg=100.0, heading_deg=20.0, pitch_deg=-15.0, offset=offset)
    turned, reference = Pose(x=1.2, y=-3.1, z=7.05, yaw=2.9), Pose(x=1.0, y=-3.0, z=7.0, yaw=-2.4)
    moved = camera_as_of(camera, turned, reference)
    places = [
        mathematics.pixel_place(
            navigation_camera(c), 12.5, 48.5, 9.0, mathematics.Pose(pose.x, pose.y, pose.z, pose.yaw)
        )
        for c, pose in ((camera, turned), (moved, reference))
    ]
    np.testing.assert_allclose(places[0], places[1], atol=1e-4)
    assert moved.name == f"front:{round(moved.heading_deg)}"


def context_of(world: BlockWorld, rig: Rig, log: Events) -> MissionContext:
    settings = completed(MissionSettings())
    vision = BlockVision(world)
    return MissionContext(
        block_ports(world, vision), block_placement(world, rig=rig), settings, policy_of(settings.viewpoint), log
    )


async def flown(world: BlockWorld, rig: Rig, log: Events) -> DeliveryResult:
    placement = block_placement(world, rig=rig)
    return await Mission(block_ports(world, BlockVision(world)), placement, MissionSettings(), log).fly(REQUEST)


async def test_one_wide_camera_finds_the_window_and_every_turn_is_a_stop() -> None:
    log, usual = Events(), Events()
    result = await flown(BlockWorld(AROUND_THE_CORNER), WIDE, log)
    five = await flown(BlockWorld(AROUND_THE_CORNER), shipped_rig("paper-five").scaled_to(SIZE), usual)
    assert (result.outcome, five.outcome) == ("delivered", "delivered")
    assert (result.rig, five.rig) == ("front-wide", "paper-five")
    turns = [e for e in log.of("turn") if "look round" in e.message and e.phase != "place"]
    assert len(turns) == 3 * result.exploration_steps
    assert not [e for e in usual.of("turn") if "look round" in e.message]
    looks = [e for e in log.of("look") if e.message.startswith("step")]
    assert all({"view", "view-90", "view+90"} <= set(e.pictures) for e in looks)
    assert sum(stop.phase == "explore" for stop in result.stops) == 3 * result.exploration_steps


async def test_a_look_under_way_is_carried_on_from_its_json_with_the_same_end() -> None:
    whole, log = await flown(BlockWorld(AROUND_THE_CORNER), WIDE, Events()), Events()
    world = BlockWorld(AROUND_THE_CORNER)
    context = context_of(world, WIDE, log)
    state, halfway = begin(REQUEST), 0
    while not state.over:
        halfway += state.looking is not None
        state = MissionState.model_validate_json(state.model_dump_json())
        state = await advance(state, await context.with_drone(state))
    result = result_of(state, context)
    assert halfway >= 3
    exact = {"outcome", "steps", "path_m", "exploration_steps", "stops", "pose"}
    assert result.model_dump(include=exact) == whole.model_dump(include=exact)
