"""Faults of the sensors that a run's flights meet, drawn for each task: a guard is tried on them."""

import zlib
from typing import get_args

import numpy as np
from pydantic import Field

from contracts.base import Wire
from contracts.sensor_profiles import FaultKind, SensorFault

_LATEST_LOOK = 15
_LONGEST_LOOKS = 6
_FAR_JUMP_M = 6.0


class SensorFaults(Wire):
    """Each kind of fault meets a flight with the chance `rate`, at a look and for as many looks as chance wants, the
    same ones in every run with this `seed`."""

    rate: float = Field(gt=0.0, le=1.0)
    seed: int = Field(default=0, ge=0, le=2**31 - 1)

    def of(self, task: str) -> tuple[SensorFault, ...]:
        """Those of the flight of that task. A higher rate adds faults to those of a lower one."""
        return tuple(fault for kind in get_args(FaultKind) if (fault := self._drawn(kind, task)) is not None)

    def _drawn(self, kind: FaultKind, task: str) -> SensorFault | None:
        rng = np.random.default_rng((self.seed, zlib.crc32(task.encode()), zlib.crc32(kind.encode())))
        if rng.random() >= self.rate:
            return None
        return SensorFault(
            kind=kind,
            first_look=int(rng.integers(1, _LATEST_LOOK + 1)),
            looks=int(rng.integers(1, _LONGEST_LOOKS + 1)),
            jump_m=round(float(rng.uniform(-_FAR_JUMP_M, _FAR_JUMP_M)), 2),
        )
