"""Wind: a mean, and gusts about it as a first-order process, as Dryden's spectra have it for the level components.

Source: MIL-F-8785C, section 3.7; the time constant is the scale length over the speed at rooftop height.
"""

import math

import numpy as np
from numpy.typing import NDArray

from contracts.scene import Wind

DT_S = 1.0 / 240.0
GUST_TIME_S = 1.8
_BLOCK = 512


class Gusts:
    """The wind at one place, step by step; the same for the same seeds."""

    def __init__(self, wind: Wind, seeds: tuple[int, ...]) -> None:
        self.mean = mean_wind(wind)
        self._sigma = wind.gusts_m_s * np.array((1.0, 1.0, 0.5))
        self._rng = np.random.default_rng(seeds)
        self._now = self._sigma * self._rng.standard_normal(3)
        self._keep = math.exp(-DT_S / GUST_TIME_S)
        self._kicks = np.zeros((0, 3))
        self._used = 0

    def next(self) -> NDArray[np.float64]:
        """(3,) m/s after one more step of DT_S."""
        if self._used >= len(self._kicks):
            self._kicks = self._rng.standard_normal((_BLOCK, 3)) * (self._sigma * math.sqrt(1.0 - self._keep**2))
            self._used = 0
        self._now = self._keep * self._now + self._kicks[self._used]
        self._used += 1
        return self.mean + self._now


def mean_wind(wind: Wind) -> NDArray[np.float64]:
    """(3,) m/s."""
    return np.array((wind.speed_m_s * math.cos(wind.towards), wind.speed_m_s * math.sin(wind.towards), 0.0))
