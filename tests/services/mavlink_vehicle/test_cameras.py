"""Real cameras: calibrations as OpenCV and ROS write them, streams that are read, frames that are of now or refused."""

import asyncio
import math
from pathlib import Path

import cv2
import numpy as np
import pytest

from contracts.cameras import MountingOffset
from contracts.geometry import Pose
from contracts.images import decode_depth, decode_jpeg
from service_kit.errors import Unavailable
from services.mavlink_vehicle.cameras.calibration import BadCalibration, Calibration, Rectifier, read_calibration
from services.mavlink_vehicle.cameras.filmed import BadCameras, FilmedCameras

MATRIX = np.array([[300.0, 0.0, 158.0], [0.0, 302.0, 121.0], [0.0, 0.0, 1.0]])
LENS = np.array([-0.2, 0.05, 0.001, -0.001, 0.0])
ROS = """\
image_width: 320
image_height: 240
camera_name: narrow_stereo
camera_matrix:
  rows: 3
  cols: 3
  data: [300, 0, 158, 0, 302, 121, 0, 0, 1]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.2, 0.05, 0.001, -0.001, 0]
"""
TOPIC = """\
height: 240
width: 320
distortion_model: equidistant
d: [0.01, 0.002, 0.0, 0.0]
k: [300.0, 0.0, 158.0, 0.0, 302.0, 121.0, 0.0, 0.0, 1.0]
"""
HERE = Pose(x=1.0, y=2.0, z=3.0, yaw=0.5)
STRAIGHT = Calibration(320, 240, MATRIX, np.zeros(5))


def written(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def opencv_file(path: Path, distortion: np.ndarray = LENS) -> Path:
    store = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for name, value in (("image_width", 320), ("image_height", 240)):
        store.write(name, value)
    store.write("camera_matrix", MATRIX)
    store.write("distortion_coefficients", distortion)
    store.release()
    return path


def test_opencv_and_ros_say_the_same_of_the_same_camera(tmp_path: Path) -> None:
    ours = read_calibration(opencv_file(tmp_path / "a.yaml"))
    theirs = read_calibration(written(tmp_path / "b.yaml", ROS))
    assert (ours.width, ours.height, ours.fisheye) == (theirs.width, theirs.height, theirs.fisheye) == (320, 240, False)
    assert np.allclose(ours.matrix, MATRIX)
    assert np.allclose(theirs.matrix, MATRIX)
    assert np.allclose(ours.distortion, theirs.distortion)
    shown = read_calibration(written(tmp_path / "c.yaml", TOPIC))
    assert shown.fisheye
    assert np.allclose(shown.matrix, MATRIX)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("nothing: 1\n", "no image_width and image_height"),
        (ROS.replace("camera_matrix", "camera"), "no camera_matrix"),
        (ROS.replace("[300,", "[-300,"), "focal lengths above 0"),
        (ROS.replace("plumb_bob", "kannala"), "'kannala' is not known; there are plumb_bob"),
        (ROS.replace("-0.2, 0.05, 0.001", "-0.2"), "3 distortion_coefficients fit no lens model"),
        (ROS.replace("data: [300", "data: 3 #"), "camera_matrix is no list of numbers"),
        ("[: }", "no YAML"),
    ],
)
def test_what_is_no_calibration_is_refused_with_what_is_wrong(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(BadCalibration, match=said):
        read_calibration(written(tmp_path / "bad.yaml", text))


def test_a_rectified_picture_shows_things_where_an_ideal_camera_would() -> None:
    calibration = Calibration(320, 240, MATRIX, LENS)
    camera = calibration.camera("front", heading_deg=0.0, pitch_deg=0.0, offset=MountingOffset())
    point = np.array([[[0.35, -0.25, 1.0]]])
    seen, _ = cv2.projectPoints(point, np.zeros(3), np.zeros(3), MATRIX, LENS)
    x, y = seen.ravel()
    picture = np.zeros((240, 320, 3), np.uint8)
    cv2.circle(picture, (round(x), round(y)), 3, (255, 255, 255), -1)
    units = np.zeros((240, 320), np.uint16)
    units[picture[:, :, 0] > 0] = 4_000
    rectifier = Rectifier(calibration, camera)
    wanted = (camera.fx_px * 0.35 + camera.cx_px, camera.fy_px * -0.25 + camera.cy_px)
    assert math.dist(wanted, (x, y)) > 2.0, "the lens moves it"
    for image in (rectifier.picture(picture)[:, :, 0], rectifier.depth(units)):
        rows, columns = np.nonzero(image > image.max() / 2)
        assert math.dist((columns.mean(), rows.mean()), wanted) < 1.0
    assert set(np.unique(rectifier.depth(units))) == {0, 4_000}, "no depth is made up"


def test_a_picture_of_another_size_than_was_calibrated_is_refused() -> None:
    camera = STRAIGHT.camera("front", heading_deg=0.0, pitch_deg=0.0, offset=MountingOffset())
    with pytest.raises(BadCalibration, match="640 x 480 pixels; it was calibrated at 320 x 240"):
        Rectifier(STRAIGHT, camera).picture(np.zeros((480, 640, 3), np.uint8))


@pytest.fixture
def filming(tmp_path: Path) -> Path:
    """A camera whose streams are files: colour as a video, depth as 16-bit pictures."""
    opencv_file(tmp_path / "front.yaml", np.zeros(5))
    video = cv2.VideoWriter(str(tmp_path / "front.avi"), cv2.VideoWriter.fourcc(*"MJPG"), 20.0, (320, 240))
    picture = np.zeros((240, 320, 3), np.uint8)
    picture[:, :160, 2] = 250  # red to the left
    for number in range(40):
        video.write(picture)
        depth = np.full((240, 320), 2_500, np.uint16)
        depth[:60], depth[60:120] = 0, 30_000
        assert cv2.imwrite(str(tmp_path / f"depth_{number:03d}.png"), depth)
    video.release()
    text = f"""
[[cameras]]
name = "front"
source = "{tmp_path}/front.avi"
calibration = "front.yaml"
offset = {{forward_m = 0.1}}
[cameras.depth]
source = "{tmp_path}/depth_%03d.png"
farthest_m = 20.0
"""
    return written(tmp_path / "cameras.toml", text)


async def looked(cameras: FilmedCameras) -> None:
    async with asyncio.timeout(20):
        while True:
            if await cameras.problem() is None:
                return
            await asyncio.sleep(0.02)


async def test_frames_of_now_are_views_with_the_pose_of_their_moment(filming: Path) -> None:
    cameras = FilmedCameras.load(filming)
    asked: list[float] = []

    def pose_at(time_s: float) -> Pose:
        asked.append(time_s)
        return HERE

    assert (cameras.carried[0].fx_px, cameras.carried[0].offset.forward_m) == (300.0, 0.1)
    cameras.start()
    try:
        await looked(cameras)
        seen = await cameras.look(cameras.carried, pose_at, depth=True)
        assert (seen.pose, asked) == (HERE, [seen.time_s])
        rgb = decode_jpeg(seen.views[0].image)
        assert rgb[120, 40, 0] > 200 > 60 > rgb[120, 280, 0]
        assert seen.views[0].depth is not None
        depth_m = decode_depth(seen.views[0].depth)
        assert np.isnan(depth_m[20, 160])
        assert np.isinf(depth_m[90, 160])
        assert depth_m[200, 160] == pytest.approx(2.5)
        assert (await cameras.look(cameras.carried, pose_at, depth=False)).views[0].depth is None
    finally:
        await cameras.close()
    await asyncio.sleep(0.6)
    with pytest.raises(Unavailable, match=r"the last picture of camera front is \d\.\d s old") as stale:
        await cameras.look(cameras.carried, pose_at, depth=True)
    assert stale.value.code == "stale_frames"


@pytest.fixture
def filming_nothing(filming: Path) -> Path:
    return written(filming, filming.read_text(encoding="utf-8").replace("front.avi", "nothing.avi"))


async def test_a_camera_that_is_not_there_is_named_with_what_is_wrong(filming_nothing: Path) -> None:
    cameras = FilmedCameras.load(filming_nothing)
    cameras.start()
    await asyncio.sleep(0.3)
    said = await cameras.problem()
    await cameras.close()
    assert said is not None
    assert said.startswith("camera front has given no picture")
    assert "nothing.avi can't be opened" in said


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        ("front.yaml", "gone.yaml", "gone.yaml: No such file"),
        ('name = "front"', 'name = "front"\ncolour = "red"', "colour"),
        ("[cameras.depth]", "[cameras.depht]", "depth"),
        ('name = "front"', 'name = "front"\nheading_deg = 90.0', "no camera that looks ahead"),
        ("[[cameras]]", "[[cameras", "not TOML"),
    ],
)
def test_a_file_that_names_no_usable_cameras_is_refused_in_one_line(
    filming: Path, before: str, after: str, said: str
) -> None:
    text = filming.read_text(encoding="utf-8").replace(before, after)
    with pytest.raises(BadCameras, match=said) as refused:
        FilmedCameras.load(written(filming, text))
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("text", ["x = " + "[" * 5_000, "x = " + "1" * 5_000])
def test_a_camera_file_beyond_what_toml_readers_take_is_told_by_name(tmp_path: Path, text: str) -> None:
    with pytest.raises(BadCameras, match=r"cameras\.toml: not TOML that can be read"):
        FilmedCameras.load(written(tmp_path / "cameras.toml", text))
