"""From the project's frame to CARLA's and back, against Unreal's own definition of a rotation."""

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from contracts.cameras import Camera, MountingOffset, pinhole_camera
from contracts.geometry import Pose
from services.carla_world.frames import Origin, Placed, camera_place, carla_place, looking_along, scene_pose, vector
from services.sim.render.views import eye_of, view_axes

metres = st.floats(-500.0, 500.0)
angles = st.floats(-math.pi, math.pi)
poses = st.builds(Pose, x=metres, y=metres, z=metres, yaw=angles)
origins = st.builds(Origin, metres, metres, metres)
places = st.tuples(metres, metres, metres)
offsets = st.builds(MountingOffset, forward_m=st.floats(-5, 5), right_m=st.floats(-5, 5), up_m=st.floats(-5, 5))
cameras = st.builds(
    lambda heading, pitch, offset: pinhole_camera(
        "c", 64, 48, horizontal_fov_deg=80.0, heading_deg=heading, pitch_deg=pitch, offset=offset
    ),
    st.floats(-180.0, 180.0),
    st.floats(-89.0, 89.0),
    offsets,
)
NEAR = {"atol": 1e-9, "rtol": 0.0}


def forward(placed: Placed) -> NDArray[np.float64]:
    """Unreal's forward vector of a rotation, in ENU: its y runs south."""
    pitch, yaw = math.radians(placed.pitch_deg), math.radians(placed.yaw_deg)
    return np.array((math.cos(pitch) * math.cos(yaw), -math.cos(pitch) * math.sin(yaw), math.sin(pitch)))


def enu(placed: Placed, origin: Origin) -> NDArray[np.float64]:
    return np.array((placed.x - origin.x_m, -(placed.y - origin.y_m), placed.z - origin.z_m))


@settings(deadline=None)
@given(poses, origins)
def test_a_pose_goes_to_carla_and_comes_back(pose: Pose, origin: Origin) -> None:
    there = carla_place(vector(pose), origin, yaw=pose.yaw)
    back = scene_pose(there, origin)
    assert np.allclose(vector(back), vector(pose), **NEAR)
    assert abs(math.remainder(back.yaw - pose.yaw, math.tau)) < 1e-9


@settings(deadline=None)
@given(poses, origins, st.floats(0.1, 100.0))
def test_a_step_ahead_is_a_step_along_carlas_forward_vector(pose: Pose, origin: Origin, step_m: float) -> None:
    there = carla_place(vector(pose), origin, yaw=pose.yaw)
    ahead = (pose.x + step_m * math.cos(pose.yaw), pose.y + step_m * math.sin(pose.yaw), pose.z)
    moved = np.asarray(carla_place(ahead, origin)[:3]) - np.asarray(there[:3])
    yaw = math.radians(there.yaw_deg)
    assert np.allclose(moved, step_m * np.array((math.cos(yaw), math.sin(yaw), 0.0)), atol=1e-7)


@settings(deadline=None)
@given(poses, cameras, origins)
def test_a_camera_in_carla_is_where_the_simulator_has_it_and_looks_where_it_looks(
    pose: Pose, camera: Camera, origin: Origin
) -> None:
    placed = camera_place(pose, camera, origin)
    assert np.allclose(enu(placed, origin), eye_of(pose, camera), atol=1e-7)
    assert np.allclose(forward(placed), view_axes(pose, camera)[2], **NEAR)


@settings(deadline=None)
@given(places, places, origins)
def test_a_probe_looks_along_the_way(
    start: tuple[float, float, float], end: tuple[float, float, float], origin: Origin
) -> None:
    gap = np.subtract(end, start)
    length = float(np.linalg.norm(gap))
    if length < 1e-3:
        return
    placed = looking_along(start, end, origin)
    assert np.allclose(enu(placed, origin), start, atol=1e-7)
    assert np.allclose(forward(placed), gap / length, atol=1e-6)


def test_left_of_the_nose_is_north_where_the_nose_points_east() -> None:
    ahead = carla_place((0.0, 0.0, 0.0), Origin(), yaw=0.0)
    left = carla_place((0.0, 1.0, 0.0), Origin(), yaw=math.pi / 2)
    assert (ahead.yaw_deg, left.y, left.yaw_deg) == (0.0, -1.0, -90.0)
