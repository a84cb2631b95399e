"""Whatever is planned, whatever the limits, however depth fails: no flight leaves them or hits what was visible."""

import asyncio
import math

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from contracts.cameras import Camera
from contracts.flight_limits import FlightLimits
from contracts.geometry import Point2, Point3, Pose
from contracts.keep_out import KeepOut
from contracts.vehicle import Move
from mission.frames import FINAL, FlightRefused
from mission.guard import guarded
from tests.mission.block import RADIUS_M, Block
from tests.mission.block_vehicle import BlockVehicle
from tests.mission.box_world import RIG

PIXELS = 48
HOUSES = st.builds(
    Block,
    x0=st.floats(-12.0, -3.0),
    x1=st.floats(3.0, 12.0),
    y0=st.floats(-6.0, -2.0),
    y1=st.floats(2.0, 9.0),
    floors=st.integers(1, 8),
    start=st.builds(
        Pose, x=st.floats(-6.0, 6.0), y=st.floats(-20.0, -7.5), z=st.floats(0.9, 3.0), yaw=st.floats(-3.0, 3.0)
    ),
)
LIMITS = st.builds(
    FlightLimits,
    geofence_m=st.floats(5.0, 60.0),
    min_height_m=st.floats(0.8, 3.0),
    max_height_m=st.floats(2.0, 40.0),
    roof_margin_m=st.floats(1.0, 10.0),
    min_clearance_m=st.floats(0.1, 2.0),
)
STEPS = st.builds(
    lambda length_m, turn, up_m: (length_m * math.cos(turn), length_m * math.sin(turn), up_m),
    st.floats(0.0, 12.0),
    st.floats(-math.pi, math.pi),
    st.one_of(st.just(0.0), st.floats(-4.0, 8.0)),
)
KEEP_OUT = st.lists(
    st.builds(
        lambda x, y, width, depth, low, tall: KeepOut(
            name="wire",
            outline=tuple(
                Point2(x=x + i * width, y=y + j * depth)
                for i, j in ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0))
            ),
            min_height_m=low,
            max_height_m=low + tall,
        ),
        st.floats(-9.0, 9.0),
        st.floats(-18.0, -4.0),
        st.floats(0.6, 4.0),
        st.floats(0.6, 2.0),
        st.floats(-1.0, 6.0),
        st.floats(0.1, 6.0),
    ),
    min_size=1,
    max_size=3,
).map(lambda volumes: [volume.model_copy(update={"name": f"wire-{at}"}) for at, volume in enumerate(volumes)])
PLANS = st.lists(st.tuples(st.lists(STEPS, max_size=3), st.floats(-3.0, 3.0)), min_size=1, max_size=4)
FAULTS = st.sampled_from(["none", "none", "invalid", "half", "specks", "sky"])


class FaultyDepth(BlockVehicle):
    """The block's drone with small pictures, and depth that fails in a way of its own at each look."""

    def __init__(self, block: Block, faults: list[str]) -> None:
        super().__init__(FaultyBlock(**vars(block)), "e1", RIG, size=PIXELS)
        self.block.faults.extend(faults)
        self.places: list[tuple[float, float, float]] = []

    def _advance(self, pose: Pose, step_m: float, level_m: float) -> None:
        super()._advance(pose, step_m, level_m)
        self.places.append((pose.x, pose.y, pose.z))


class FaultyBlock(Block):
    """Depth of it may be invalid, in part, or have specks; never a free way where something stands."""

    @property
    def faults(self) -> list[str]:
        return vars(self).setdefault("_faults", [])

    def depth_m(self, pose: Pose, camera: Camera) -> np.ndarray:
        depth = super().depth_m(pose, camera)
        fault = self.faults[round(7 * (pose.x + pose.y + pose.z)) % len(self.faults)] if self.faults else "none"
        if fault == "invalid":
            depth[:] = np.nan
        elif fault == "half":
            depth[: len(depth) // 2 + 4] = np.nan
        elif fault == "specks":
            depth[::7, ::5] = 1.0
        elif fault == "sky":
            depth[np.isinf(depth)] = np.nan
        return depth


async def _fly(house: Block, limits: FlightLimits, plans: list, faults: list[str]) -> list[tuple[float, float, float]]:
    """The places flown through."""
    vehicle = FaultyDepth(house, faults)
    guard = await guarded(vehicle, limits, None)
    home = house.start
    for steps, yaw in plans:
        here, path = vehicle.pose, []
        for dx, dy, dz in steps:
            last = path[-1] if path else here
            path.append(Point3(x=last.x + dx, y=last.y + dy, z=last.z + dz))
        try:
            await guard.fly((await vehicle.state()).moves + 1, Move(path=tuple(path), yaw=yaw))
        except FlightRefused as refusal:
            if refusal.reason in FINAL:
                await guard.end(refusal.reason)
                break
    assert not vehicle.collided
    assert all(house.distance(*place) >= RADIUS_M for place in vehicle.places)
    if vehicle.pose.z < 0.8:
        return vehicle.places  # it has landed
    for x, y, z in vehicle.places:
        assert math.hypot(x - home.x, y - home.y) <= limits.geofence_m + 1e-6
        assert z >= min(limits.min_height_m, home.z) - 1e-6
        assert z <= max(home.z, min(limits.max_height_m, max(house.top, home.z) + limits.roof_margin_m)) + 1e-6
    return vehicle.places


@settings(max_examples=60, derandomize=True, deadline=None, suppress_health_check=list(HealthCheck))
@given(HOUSES, LIMITS, KEEP_OUT, PLANS)
def test_no_plan_leads_into_a_volume_to_keep_out_of(
    house: Block, limits: FlightLimits, keep_out: list[KeepOut], plans: list
) -> None:
    room_m = RADIUS_M + limits.min_clearance_m
    start = house.start
    apart = tuple(v for v in keep_out if _away_m(v, (start.x, start.y, start.z)) > room_m)
    places = asyncio.run(_fly(house, limits.tightened(FlightLimits(keep_out=apart)), plans, ["none"]))
    assert all(_away_m(volume, place) >= room_m - 1e-6 for volume in apart for place in places)


def _away_m(box: KeepOut, place: tuple[float, float, float]) -> float:
    """From a box to a place, the least of level and upright; 0 within."""
    xs, ys = zip(*box.corners, strict=True)
    x, y, z = place
    level = math.hypot(max(min(xs) - x, x - max(xs), 0.0), max(min(ys) - y, y - max(ys), 0.0))
    return max(level, box.min_height_m - z, z - box.max_height_m)


CUT = (
    Block(x0=-3.0, x1=3.0, y0=-6.0, y1=2.0, floors=1, start=Pose(x=0.0, y=-10.0, z=1.0, yaw=0.0)),
    FlightLimits(geofence_m=5.0, min_height_m=1.0, max_height_m=2.0, roof_margin_m=1.0, min_clearance_m=1.0),
    [([(5.0 * math.cos(1.0), 5.0 * math.sin(1.0), 0.0)], 0.0)],
    ["half"],
)
"""Of every frame only the lower part arrives; a wall's foot is all that is seen of a house."""
CUT_ASIDE = (
    Block(x0=-3.0, x1=3.0, y0=-2.0, y1=2.0, floors=1, start=Pose(x=0.0, y=-14.0, z=2.0, yaw=0.0)),
    FlightLimits(geofence_m=13.0, min_height_m=1.0, max_height_m=2.0, roof_margin_m=1.0, min_clearance_m=1.0),
    [
        ([(4.0 * math.cos(1.0), 4.0 * math.sin(1.0), 0.0)], 0.0),
        ([(10.0 * math.cos(2.0), 10.0 * math.sin(2.0), 0.0)], 0.0),
    ],
    ["half"],
)
"""As before, and the foot fills few columns of one picture; level ground the rest."""
CUT_SPECKS = (
    Block(x0=-3.0, x1=3.0, y0=-2.0, y1=2.0, floors=1, start=Pose(x=0.0, y=-9.0, z=2.0, yaw=0.0)),
    FlightLimits(geofence_m=8.0, min_height_m=1.0, max_height_m=2.0, roof_margin_m=1.0, min_clearance_m=1.0),
    [([(8.0 * math.cos(2.0), 8.0 * math.sin(2.0), 0.0)], 0.0)],
    ["half"],
)
"""As before, and the ground beside the foot is so little of the picture that it passes for specks."""


@example(*CUT)
@example(*CUT_ASIDE)
@example(*CUT_SPECKS)
@settings(max_examples=200, derandomize=True, deadline=None, suppress_health_check=list(HealthCheck))
@given(HOUSES, LIMITS, PLANS, st.lists(FAULTS, min_size=1, max_size=5))
def test_no_plan_leaves_the_limits_or_hits_what_was_visible(
    house: Block, limits: FlightLimits, plans: list, faults: list[str]
) -> None:
    asyncio.run(_fly(house, limits, plans, faults))


@pytest.mark.slow
@settings(max_examples=10_000, deadline=None, suppress_health_check=list(HealthCheck))
@given(HOUSES, LIMITS, PLANS, st.lists(FAULTS, min_size=1, max_size=5))
def test_ten_thousand_plans_leave_the_limits_nowhere_and_hit_nothing(
    house: Block, limits: FlightLimits, plans: list, faults: list[str]
) -> None:
    asyncio.run(_fly(house, limits, plans, faults))
