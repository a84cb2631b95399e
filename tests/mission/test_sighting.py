"""From a box to a place by depth, and from a place back to a box."""

import math

import pytest

from contracts.geometry import Box, Point3, Pose
from contracts.vlm_gateway import Match
from mission.looks import Look, Sight, look_of
from mission.sighting import is_dismissed, locate, project
from mission.stages import Extent
from mission.state import Dismissed
from tests.cameras import NAMES
from tests.mission.block import Block
from tests.mission.block_vehicle import BlockWorld
from tests.mission.box_world import block_placement


async def look_from(pose: Pose) -> Look:
    vehicle = await block_placement(BlockWorld(Block(start=pose))).begin("look")
    return look_of(await vehicle.observe(), ())


def towards(look: Look, heading_deg: int) -> Sight:
    return look.sights[NAMES[heading_deg]]


@pytest.mark.parametrize(
    ("heading", "yaw"), [(0, math.pi / 2), (-45, math.pi / 4), (45, 3 * math.pi / 4), (90, math.pi)]
)
async def test_a_box_on_the_facade_is_placed_where_the_ray_meets_the_wall(heading: int, yaw: float) -> None:
    look = await look_from(Pose(x=1.0, y=-14.0, z=9.0, yaw=yaw))
    box = Box(x_min=0.6, y_min=0.3, x_max=0.7, y_max=0.4)
    found = locate(Match(camera=NAMES[heading], box=box), towards(look, heading), floor_z=10.5, floor_height_m=3.0)
    # the view looks north at a wall 8 m ahead: 0.15 of the width right of the middle, 0.15 above it
    assert found.place is not None
    assert (found.place.x, found.place.y, found.place.z) == pytest.approx((1.0 + 2.4, -6.0, 9.0 + 2.4), abs=0.02)
    assert found.rejected is None
    assert found.extent == pytest.approx(Extent(1.6, 1.6), abs=0.01)


async def test_a_place_projects_back_into_the_box_it_came_from() -> None:
    look = await look_from(Pose(x=1.0, y=-14.0, z=9.0, yaw=math.pi / 2))
    box = Box(x_min=0.4, y_min=0.3, x_max=0.5, y_max=0.45)
    found = locate(Match(camera="front", box=box), towards(look, 0), floor_z=10.0, floor_height_m=3.0)
    assert found.place is not None
    assert found.extent is not None
    back = project(found.place, found.extent, look)
    assert back is not None
    assert back[0].view.camera.name == "front"
    for edge in ("x_min", "y_min", "x_max", "y_max"):
        assert getattr(back[1], edge) == pytest.approx(getattr(box, edge), abs=1e-6)


async def test_what_lies_behind_the_drone_is_in_no_picture() -> None:
    look = await look_from(Pose(x=1.0, y=-14.0, z=9.0, yaw=math.pi / 2))
    assert project(Point3(x=1.0, y=-30.0, z=9.0), Extent(1.0, 1.0), look) is None


@pytest.mark.parametrize(("floor_z", "kept"), [(9.0, True), (11.2, True), (11.4, False), (6.6, False)])
async def test_a_sighting_off_the_floor_asked_for_is_rejected(floor_z: float, kept: bool) -> None:
    look = await look_from(Pose(x=0.0, y=-14.0, z=9.0, yaw=math.pi / 2))
    middle = Match(camera="front", box=Box(x_min=0.45, y_min=0.45, x_max=0.55, y_max=0.55))
    found = locate(middle, towards(look, 0), floor_z=floor_z, floor_height_m=3.0)
    assert (found.rejected is None) is kept


async def test_a_sighting_too_far_to_be_sure_is_rejected_with_its_distance() -> None:
    look = await look_from(Pose(x=0.0, y=-40.0, z=9.0, yaw=math.pi / 2))
    middle = Match(camera="front", box=Box(x_min=0.45, y_min=0.45, x_max=0.55, y_max=0.55))
    found = locate(middle, towards(look, 0), floor_z=9.0, floor_height_m=3.0)
    assert found.rejected is not None
    assert "34.0 m" in found.rejected


THING = Point3(x=0.0, y=0.0, z=10.0)
SEEN_BEFORE = Dismissed(place=THING, seen_from=Pose(x=0.0, y=-6.0, z=10.0, yaw=1.57), confidence=0.45)


@pytest.mark.parametrize(
    ("at", "seen_from", "confidence", "claimable", "held", "why"),
    [
        (0.0, (1.0, -6.0), 0.45, True, True, "the same again"),
        (0.0, (1.0, -6.0), 0.60, True, False, "surer than before"),
        (0.0, (6.0, -6.0), 0.45, True, False, "from another side"),
        (0.0, (6.0, -6.0), 0.60, False, True, "not sure enough to be claimed"),
        (2.0, (1.0, -6.0), 0.45, True, False, "another thing"),
    ],
)
def test_what_was_dismissed_is_looked_at_again_only_for_a_reason(
    at: float, seen_from: tuple[float, float], confidence: float, claimable: bool, held: bool, why: str
) -> None:
    pose = Pose(x=seen_from[0], y=seen_from[1], z=10.0, yaw=1.57)
    place = Point3(x=at, y=0.0, z=10.0)
    assert is_dismissed((SEEN_BEFORE,), place, pose, confidence, claimable=claimable) is held, why
