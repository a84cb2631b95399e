"""Chance by name, fast enough for five pictures a look: white noise is cut from one bank at an offset that the look's
generator draws, blotches are a coarse random picture made large.
"""

import zlib
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

BANK_CODES_PER_SIGMA = 16
_BANK_SEED = 20_261_130
_BANK = 1 << 22
_BLOTCH_PX = 16


def generator(seeds: tuple[int, ...], look: int, camera: str) -> np.random.Generator:
    """Of one camera's frame at one look of an episode."""
    return np.random.default_rng((*seeds, look, zlib.crc32(camera.encode())))


def white(rng: np.random.Generator, count: int) -> NDArray[np.int8]:
    """(count,) normal, 16 codes to the standard deviation, cut off at 7.9 of them; at most four millions."""
    bank = _bank()
    start = int(rng.integers(0, max(1, len(bank) - count)))
    return bank[start : start + count]


def blotches(rng: np.random.Generator, height: int, width: int, share: float) -> NDArray[np.bool_]:
    """(height, width): smooth patches some 16 pixels across that cover about `share` of it."""
    if share <= 0.0 or share >= 1.0:
        return np.full((height, width), share >= 1.0)
    coarse = rng.integers(0, 256, (height // _BLOTCH_PX + 2, width // _BLOTCH_PX + 2), np.uint8)
    field = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_LINEAR)
    return np.asarray(field < _level(round(share, 3)))


@cache
def _bank() -> NDArray[np.int8]:
    drawn = np.random.default_rng(_BANK_SEED).standard_normal(_BANK, np.float32)
    return np.clip(np.rint(drawn * BANK_CODES_PER_SIGMA), -127, 127).astype(np.int8)


@cache
def _level(share: float) -> int:
    """Below which brightness `share` of a smoothed random picture lies."""
    coarse = np.random.default_rng(_BANK_SEED).integers(0, 256, (130, 130), np.uint8)
    field = cv2.resize(coarse, (128 * _BLOTCH_PX, 128 * _BLOTCH_PX), interpolation=cv2.INTER_LINEAR)
    return int(np.quantile(field, share))
