"""CARLA's depth pictures in metres.

A depth camera codes planar depth as a fraction of 1000 m in three bytes: (R + 256 G + 65536 B) / (2^24 - 1). What is
1000 m away is the sky. Source: https://carla.readthedocs.io/en/0.9.16/ref_sensors/#depth-camera
"""

import numpy as np
from numpy.typing import NDArray

FAR_M = 1000.0
CODES = 2**24 - 1
QUANTUM_M = FAR_M / CODES
"""What a step of the code is worth: 0.06 mm."""


def decoded_depth(bgra: NDArray[np.uint8]) -> NDArray[np.float64]:
    """(H, W, 4) as the camera sends it, blue first, to (H, W) metres along the optical axis; inf for the sky."""
    blue, green, red = (bgra[..., channel].astype(np.uint32) for channel in range(3))
    codes = red + (green << 8) + (blue << 16)
    metres: NDArray[np.float64] = codes * QUANTUM_M
    metres[codes == CODES] = np.inf
    return metres
