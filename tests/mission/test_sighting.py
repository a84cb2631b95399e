"""From a box to a place by depth, and from a place back to a box."""

import math

import pytest

from contracts.geometry import Box, Heading, Point3, Pose
from contracts.sim import EpisodeQuestion
from contracts.vlm_gateway import Match
from mission.asking import CallBook
from mission.sighting import Dismissed, Extent, locate, project
from mission.sortie import Look, Sight
from tests.mission.box_world import RIG, Block, BlockWorld, block_scene


async def look_from(pose: Pose) -> Look:
    world = BlockWorld(Block(start=pose))
    episode = await world.start(EpisodeQuestion(scene=block_scene(world.block)))
    seen = await world.observe(episode.id, [camera.name for camera in RIG.cameras])
    return Look(seen, {sight.heading_deg: sight for sight in (Sight(seen.pose, view) for view in seen.views)})


@pytest.mark.parametrize(
    ("heading", "yaw"), [(0, math.pi / 2), (-45, math.pi / 4), (45, 3 * math.pi / 4), (90, math.pi)]
)
async def test_a_box_on_the_facade_is_placed_where_the_ray_meets_the_wall(heading: Heading, yaw: float) -> None:
    look = await look_from(Pose(x=1.0, y=-14.0, z=9.0, yaw=yaw))
    box = Box(x_min=0.6, y_min=0.3, x_max=0.7, y_max=0.4)
    found = locate(Match(heading_deg=heading, box=box), look.sights[heading], floor_z=10.5, floor_height_m=3.0)
    # the view looks north at a wall 8 m ahead: 0.15 of the width right of the middle, 0.15 above it
    assert found.place is not None
    assert (found.place.x, found.place.y, found.place.z) == pytest.approx((1.0 + 2.4, -6.0, 9.0 + 2.4), abs=0.02)
    assert found.rejected is None
    assert found.extent == pytest.approx(Extent(1.6, 1.6), abs=0.01)


async def test_a_place_projects_back_into_the_box_it_came_from() -> None:
    look = await look_from(Pose(x=1.0, y=-14.0, z=9.0, yaw=math.pi / 2))
    box = Box(x_min=0.4, y_min=0.3, x_max=0.5, y_max=0.45)
    found = locate(Match(heading_deg=0, box=box), look.sights[0], floor_z=10.0, floor_height_m=3.0)
    assert found.place is not None
    assert found.extent is not None
    back = project(found.place, found.extent, look)
    assert back is not None
    assert back[0].heading_deg == 0
    for edge in ("x_min", "y_min", "x_max", "y_max"):
        assert getattr(back[1], edge) == pytest.approx(getattr(box, edge), abs=1e-6)


async def test_what_lies_behind_the_drone_is_in_no_picture() -> None:
    look = await look_from(Pose(x=1.0, y=-14.0, z=9.0, yaw=math.pi / 2))
    assert project(Point3(x=1.0, y=-30.0, z=9.0), Extent(1.0, 1.0), look) is None


@pytest.mark.parametrize(("floor_z", "kept"), [(9.0, True), (11.2, True), (11.4, False), (6.6, False)])
async def test_a_sighting_off_the_floor_asked_for_is_rejected(floor_z: float, kept: bool) -> None:
    look = await look_from(Pose(x=0.0, y=-14.0, z=9.0, yaw=math.pi / 2))
    middle = Match(heading_deg=0, box=Box(x_min=0.45, y_min=0.45, x_max=0.55, y_max=0.55))
    found = locate(middle, look.sights[0], floor_z=floor_z, floor_height_m=3.0)
    assert (found.rejected is None) is kept


async def test_a_sighting_too_far_to_be_sure_is_rejected_with_its_distance() -> None:
    look = await look_from(Pose(x=0.0, y=-40.0, z=9.0, yaw=math.pi / 2))
    middle = Match(heading_deg=0, box=Box(x_min=0.45, y_min=0.45, x_max=0.55, y_max=0.55))
    found = locate(middle, look.sights[0], floor_z=9.0, floor_height_m=3.0)
    assert found.rejected is not None
    assert "34.0 m" in found.rejected


THING = Point3(x=0.0, y=0.0, z=10.0)
SEEN_BEFORE = Dismissed(THING, Pose(x=0.0, y=-6.0, z=10.0, yaw=1.57), 0.45)


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
    assert SEEN_BEFORE.holds(place, pose, confidence, claimable=claimable) is held, why


def test_wall_time_adds_up_by_part() -> None:
    book = CallBook()
    book.spend("observe", 1.5)
    book.spend("observe", 0.5)
    assert book.seconds == {"observe": 2.0}
