"""What real depth cameras make of a plane, of an edge, of what is thin, of glass, and of the sky."""

import numpy as np
import pytest
from numpy.typing import NDArray

from contracts.sensor_profiles import StereoDepth, TimeOfFlightDepth, shipped_sensors
from services.sim.sensors.chance import generator
from services.sim.sensors.depth import Frame, sensed_depth

SIZE = 400
D455, D435, TOF = (shipped_sensors(name).depth for name in ("d455", "d435", "tof-10m"))
CAMERAS = {"d455": D455, "d435": D435, "tof-10m": TOF}


def frame(depth_m: NDArray[np.float64] | float, glass: NDArray[np.bool_] | None = None) -> Frame:
    """A checkered picture, which can be matched everywhere, at these depths; inf is the sky."""
    metres = np.broadcast_to(np.asarray(depth_m, np.float64), (SIZE, SIZE))
    units = np.where(np.isinf(metres), 65_535, np.rint(np.where(np.isinf(metres), 0.0, metres) / 0.002))
    checkers = ((np.indices((SIZE, SIZE)).sum(axis=0) // 2) % 2 * 120 + 60).astype(np.uint8)
    return Frame(np.repeat(checkers[..., None], 3, axis=2), units.astype(np.uint16), glass)


def sensed(what: Frame, sensor: object, look: int = 1) -> NDArray[np.uint16]:
    assert isinstance(sensor, StereoDepth | TimeOfFlightDepth)
    whole = sensor.model_copy(update={"partial_frames": 0.0})
    return sensed_depth(what, whole, generator((1, 2), look, "front"))


def errors_m(sensor: object, depth_m: float) -> NDArray[np.float64]:
    found = sensed(frame(depth_m), sensor)
    return found[found > 0] * 0.002 - depth_m


@pytest.mark.parametrize(("name", "near", "far"), [("d455", 3.0, 12.0), ("d435", 2.0, 8.0)])
def test_the_error_of_two_cameras_grows_with_the_square_of_the_distance(name: str, near: float, far: float) -> None:
    sensor = CAMERAS[name]
    assert isinstance(sensor, StereoDepth)
    for depth_m in (near, far):
        told = depth_m**2 * sensor.disparity_noise_px / (sensor.focal_px * sensor.baseline_m)
        assert np.std(errors_m(sensor, depth_m)) == pytest.approx(told, rel=0.12)


def test_the_error_of_time_of_flight_is_what_the_profile_says() -> None:
    assert isinstance(TOF, TimeOfFlightDepth)
    for depth_m in (1.0, 5.0, 9.0):
        told = TOF.noise_m + TOF.noise_per_m2 * depth_m**2
        assert np.std(errors_m(TOF, depth_m)) == pytest.approx(told, rel=0.12)


def test_depths_of_two_cameras_come_in_steps_of_disparity() -> None:
    assert isinstance(D455, StereoDepth)
    seen = np.unique(sensed(frame(15.0), D455)[sensed(frame(15.0), D455) > 0]) * 0.002
    disparities = D455.focal_px * D455.baseline_m / seen
    steps = np.diff(np.sort(disparities)) / D455.disparity_step_px
    assert steps == pytest.approx(np.rint(steps), abs=0.03)
    assert len(seen) < 40


@pytest.mark.parametrize("name", CAMERAS)
def test_nothing_is_valid_in_the_sky_beyond_the_range_or_nearer_than_it(name: str) -> None:
    sensor = CAMERAS[name]
    assert isinstance(sensor, StereoDepth | TimeOfFlightDepth)
    for depth_m in (np.inf, sensor.max_m * 1.4, sensor.min_m * 0.7):
        assert not sensed(frame(depth_m), sensor).any()
    inside = sensed(frame(sensor.max_m * 0.7), sensor)
    assert (inside > 0).mean() > 0.98
    assert inside.max() * 0.002 <= sensor.max_m + 0.001
    assert 65_535 not in inside


@pytest.mark.parametrize("name", CAMERAS)
def test_window_panes_have_holes_and_walls_have_none(name: str) -> None:
    sensor = CAMERAS[name]
    assert isinstance(sensor, StereoDepth | TimeOfFlightDepth)
    pane = np.zeros((SIZE, SIZE), np.bool_)
    pane[100:300, 100:300] = True
    holes = sensed(frame(5.0, pane), sensor) == 0
    assert holes[pane].mean() == pytest.approx(sensor.glass_holes, abs=0.12)
    assert not holes[~pane].any()


def test_beside_an_edge_pixels_lie_between_both_sides() -> None:
    metres = np.full((SIZE, SIZE), 8.0)
    metres[:, : SIZE // 2] = 4.0
    found = sensed(frame(metres), TOF) * 0.002
    between = (found > 4.5) & (found < 6.8)
    assert between[:, SIZE // 2 - 2 : SIZE // 2 + 2].sum() > 0.2 * SIZE
    assert not between[:, : SIZE // 2 - 2].any()
    assert not between[:, SIZE // 2 + 2 :].any()


def test_thin_things_are_partly_not_seen() -> None:
    metres = np.full((SIZE, SIZE), 8.0)
    metres[:, 50::40] = 4.0
    found = sensed(frame(metres), D455)[:, 50::40] * 0.002
    assert (found == 0).mean() > 0.15
    assert (found > 7.0).mean() > 0.1
    assert ((found > 3.0) & (found < 4.5)).mean() > 0.15


def test_a_plain_wall_cannot_be_matched_by_two_cameras() -> None:
    plain = frame(5.0)._replace(rgb=np.full((SIZE, SIZE, 3), 150, np.uint8))
    assert isinstance(D455, StereoDepth)
    assert (sensed(plain, D455) == 0).mean() == pytest.approx(D455.plain_holes, abs=0.12)
    assert (sensed(plain, TOF) > 0).all()


def test_the_same_seeds_and_look_give_the_same_depth_and_others_do_not() -> None:
    wall = frame(6.0)
    assert np.array_equal(sensed(wall, D455, 3), sensed(wall, D455, 3))
    assert not np.array_equal(sensed(wall, D455, 3), sensed(wall, D455, 4))


def test_now_and_then_a_frame_ends_before_the_picture_does() -> None:
    assert isinstance(D455, StereoDepth)
    often = D455.model_copy(update={"partial_frames": 0.3})
    partial = 0
    for look in range(100):
        rows = (sensed_depth(frame(5.0), often, generator((4,), look, "front")) > 0).any(axis=1)
        assert rows[: rows.sum()].all()
        partial += not rows.all()
    assert 15 < partial < 48
