"""A camera's calibration as OpenCV and ROS write it, and pictures as an ideal pinhole camera would have taken them."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from contracts.cameras import Camera, MountingOffset

MAX_BYTES = 256 * 1024
PINHOLE_MODELS = ("plumb_bob", "rational_polynomial", "")
FISHEYE_MODELS = ("equidistant", "fisheye")
SIZES = (("image_width", "image_height"), ("width", "height"))
MATRICES = ("camera_matrix", "cameraMatrix", "K", "k")
DISTORTIONS = ("distortion_coefficients", "distCoeffs", "dist_coeffs", "D", "d")

Floats = NDArray[np.float64]


class BadCalibration(ValueError):
    """A file that is no calibration; the message says what is missing or wrong."""


class Calibration(NamedTuple):
    """`matrix` (3, 3): focal lengths and principal point in pixels of a picture of `width` x `height`; `distortion`
    (N,) in OpenCV's order, of a `fisheye` or an ordinary lens."""

    width: int
    height: int
    matrix: Floats
    distortion: Floats
    fisheye: bool = False

    def camera(self, name: str, *, heading_deg: float, pitch_deg: float, offset: MountingOffset) -> Camera:
        """The ideal camera whose pictures `Rectifier` makes. Raises ValueError."""
        return Camera(
            name=name,
            width=self.width,
            height=self.height,
            fx_px=float(self.matrix[0, 0]),
            fy_px=float(self.matrix[1, 1]),
            cx_px=float(self.matrix[0, 2]),
            cy_px=float(self.matrix[1, 2]),
            heading_deg=heading_deg,
            pitch_deg=pitch_deg,
            offset=offset,
        )


class Rectifier:
    """Takes the lens's distortion out, and brings pictures to the size of `camera`, which is the calibration's own,
    scaled or not."""

    def __init__(self, calibration: Calibration, camera: Camera) -> None:
        self.camera = camera
        self._size = (calibration.width, calibration.height)
        wanted = np.array([[camera.fx_px, 0, camera.cx_px], [0, camera.fy_px, camera.cy_px], [0, 0, 1.0]])
        size = (camera.width, camera.height)
        if calibration.fisheye:
            self._maps = cv2.fisheye.initUndistortRectifyMap(
                calibration.matrix, calibration.distortion[:4], np.eye(3), wanted, size, cv2.CV_16SC2
            )
        else:
            self._maps = cv2.initUndistortRectifyMap(
                calibration.matrix, calibration.distortion, np.eye(3), wanted, size, cv2.CV_16SC2
            )

    def picture(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """(H, W, 3) of the lens -> of the ideal camera. Raises BadCalibration for another size."""
        self._check(image.shape[1], image.shape[0])
        return np.asarray(cv2.remap(image, *self._maps, cv2.INTER_LINEAR), np.uint8)

    def depth(self, units: NDArray[np.uint16]) -> NDArray[np.uint16]:
        """(H, W), registered to the picture; one of another size is of the same field of view. No value is made up: the
        nearest one is taken, and 0 where there is none."""
        if (units.shape[1], units.shape[0]) != self._size:
            units = np.asarray(cv2.resize(units, self._size, interpolation=cv2.INTER_NEAREST), np.uint16)
        return np.asarray(cv2.remap(units, *self._maps, cv2.INTER_NEAREST), np.uint16)

    def _check(self, width: int, height: int) -> None:
        if (width, height) != self._size:
            wide, high = self._size
            raise BadCalibration(
                f"camera {self.camera.name} gives pictures of {width} x {height} pixels; it was calibrated at "
                f"{wide} x {high}: calibrate it at the size it films at, or let it film at that one"
            )


def read_calibration(path: Path) -> Calibration:
    """OpenCV's YAML (`camera_matrix`, `distortion_coefficients` as `!!opencv-matrix`) or ROS's camera_info, as its
    calibrator writes it or its topic shows it. Raises BadCalibration."""
    try:
        if path.stat().st_size > MAX_BYTES:
            raise BadCalibration(f"{path} is larger than {MAX_BYTES} bytes: that is no calibration")
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise BadCalibration(f"{path}: {error.strerror}; name a readable file") from None
    except UnicodeDecodeError:
        raise BadCalibration(f"{path} is no text file") from None
    if not text.lstrip().startswith("%YAML"):
        text = "%YAML:1.0\n---\n" + text.removeprefix("---\n")
    try:
        store = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
    except (cv2.error, SystemError):
        raise BadCalibration(f"{path} is no YAML that OpenCV reads") from None
    try:
        return _calibration(store.getNode, str(path))
    except cv2.error as error:
        raise BadCalibration(f"{path} is not written as a calibration is: {str(error).splitlines()[0]}") from None
    finally:
        store.release()


def _calibration(node: Callable[[str], Any], source: str) -> Calibration:
    """Raises BadCalibration."""
    width, height = next(
        ((node(w), node(h)) for w, h in SIZES if not node(w).empty() and not node(h).empty()), (None, None)
    )
    if width is None or height is None:
        raise BadCalibration(f"{source}: no image_width and image_height; it must say at what size it was calibrated")
    matrix = _numbers(node, MATRICES, source, "camera_matrix")
    if matrix.size != 9 or matrix[0] <= 0.0 or matrix[4] <= 0.0:
        raise BadCalibration(f"{source}: camera_matrix must be 3 x 3 with focal lengths above 0, not {matrix.tolist()}")
    distortion = _numbers(node, DISTORTIONS, source, "distortion_coefficients")
    named = node("distortion_model")
    model = named.string() if not named.empty() else ""
    fisheye = model in FISHEYE_MODELS or (not node("fisheye_model").empty() and node("fisheye_model").real() > 0.0)
    if not fisheye and model not in PINHOLE_MODELS:
        known = ", ".join((*PINHOLE_MODELS[:-1], *FISHEYE_MODELS))
        raise BadCalibration(f"{source}: distortion_model {model!r} is not known; there are {known}")
    if distortion.size not in ((4,) if fisheye else (0, 4, 5, 8, 12, 14)):
        raise BadCalibration(f"{source}: {distortion.size} distortion_coefficients fit no lens model")
    return Calibration(int(width.real()), int(height.real()), matrix.reshape(3, 3), distortion, fisheye)


def _numbers(node: Callable[[str], Any], names: tuple[str, ...], source: str, usual: str) -> Floats:
    """A matrix of OpenCV's, a `data` list below the name, or a plain list. Raises BadCalibration."""
    found = next((node(name) for name in names if not node(name).empty()), None)
    if found is None:
        raise BadCalibration(f"{source}: no {usual}")
    if found.isMap():  # OpenCV's matrices and ROS's alike
        found = found.getNode("data")
    if not found.isSeq():
        raise BadCalibration(f"{source}: {usual} is no list of numbers")
    numbers = np.array([found.at(i).real() for i in range(found.size())], np.float64)
    if not np.isfinite(numbers).all() or (np.abs(numbers) > 1e8).any():
        raise BadCalibration(f"{source}: {usual} holds something that is no number")
    return numbers
