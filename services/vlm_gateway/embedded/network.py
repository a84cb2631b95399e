"""The two trained networks, run by ONNX Runtime."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
import onnxruntime
from numpy.typing import NDArray

from services.vlm_gateway.embedded.exported import FOLDER, NAMER_FILE, PROPOSER_FILE

Floats = NDArray[np.float32]
MAX_CROPS = 64
"""Crops of one run: more at once take memory and no less time."""


class Maps(NamedTuple):
    """What the proposer says of N pictures: objectness, building, window, row (N, h, w) 0..1; box (N, 4, h, w) pixels
    to the left, top, right, bottom."""

    objectness: Floats
    box: Floats
    building: Floats
    window: Floats
    row: Floats


class Named(NamedTuple):
    """What the namer says of M crops: kind (M, C + 1) and colour (M, K) logits; box (M, 4) 0..1 of the crop."""

    kind: Floats
    colour: Floats
    box: Floats


class Networks:
    """Both networks; `threads` may share one: nothing changes in it."""

    def __init__(self, folder: Path = FOLDER, *, threads: int = 1) -> None:
        """Raises OSError where a file is missing, ValueError where ONNX Runtime can't read it."""
        self._proposer = _session(folder / PROPOSER_FILE, threads)
        self._namer = _session(folder / NAMER_FILE, threads)

    def propose(self, pictures: NDArray[np.uint8]) -> Maps:
        """pictures: (N, H, W, 3) RGB, H and W multiples of 32."""
        return Maps(*self._proposer.run(list(Maps._fields), {"pictures": pictures}))

    def name(self, crops: NDArray[np.uint8]) -> Named:
        """crops: (M, S, S, 3) RGB, M at least 1."""
        parts = [
            self._namer.run(list(Named._fields), {"crops": crops[k : k + MAX_CROPS]})
            for k in range(0, len(crops), MAX_CROPS)
        ]
        return Named(*(np.concatenate(outputs) for outputs in zip(*parts, strict=True)))


def _session(path: Path, threads: int) -> onnxruntime.InferenceSession:
    data = path.read_bytes()
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    options.log_severity_level = 3
    try:
        return onnxruntime.InferenceSession(data, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # ONNX Runtime's own errors share no base beneath this
        raise ValueError(f"{path.name} is no network that can be run: {str(error).strip()[:300]}") from None
