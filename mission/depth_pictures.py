"""Depth as a picture for people. It is for looking at alone: nothing is ever measured in it."""

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from contracts.images import INVALID, NO_RETURN

EDGE_PX = 240
NEAR_M, FAR_M = 0.5, 40.0
"""The ends of the colours, which go evenly with the logarithm of depth."""
UNKNOWN_BGR, NOTHING_BGR = (0, 0, 0), (255, 255, 255)
JPEG_QUALITY = 85


def depth_picture(units: NDArray[np.uint16], metres_per_unit: float) -> bytes:
    """A JPEG of at most `EDGE_PX` pixels a side, every n-th pixel of `units` (H, W; `contracts.images.DepthMap`): from
    yellow, near, to violet, far; black where depth is unknown, white where nothing is within reach."""
    step = math.ceil(max(units.shape) / EDGE_PX)
    seen = units[::step, ::step]
    metres = np.maximum(seen.astype(np.float32) * np.float32(metres_per_unit), NEAR_M)
    share = np.minimum(np.log(metres / NEAR_M) / math.log(FAR_M / NEAR_M), 1.0)
    shown = cv2.applyColorMap((255 - 255 * share).astype(np.uint8), cv2.COLORMAP_VIRIDIS)
    shown[seen == INVALID] = UNKNOWN_BGR
    shown[seen == NO_RETURN] = NOTHING_BGR
    done, jpeg = cv2.imencode(".jpg", shown, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    if not done:
        raise RuntimeError("OpenCV could not encode a picture of depth as JPEG")
    return jpeg.tobytes()
