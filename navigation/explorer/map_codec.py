"""The memory as bytes of one fixed length, so that a reader can refuse anything else before it looks inside.

A header, then two planes of one byte a cell: what is known of it (2 bits state, 2 bits attempts, one bit each for body,
inspected, expected, awaited) and its normal.
"""

import math
import struct

import numpy as np

from navigation.explorer.explore import CUT_LIFTED, Memory
from navigation.explorer.facade import Seed
from navigation.explorer.map import CELL_M, OCCUPIED, SIZE, UNKNOWN, Map

VERSION = 1
_MAGIC = b"CXMP"
_HEADER = struct.Struct("<4sHHf4BI8d")
LENGTH = _HEADER.size + 2 * SIZE * SIZE
_FARTHEST_M = 20_000.0


class BadMemory(ValueError):
    """Bytes that are no memory of this version; the message says why."""


def to_bytes(memory: Memory) -> bytes:
    """LENGTH bytes, little-endian."""
    grid, seed = memory.map, memory.seed
    stop = memory.stop or (0.0, 0.0)
    header = _HEADER.pack(
        _MAGIC,
        VERSION,
        SIZE,
        CELL_M,
        memory.cut,
        min(memory.relaxed, 255),
        min(memory.stuck, 255),
        memory.stop is not None,
        memory.steps,
        grid.west_m,
        grid.south_m,
        seed.x,
        seed.y,
        *seed.normal,
        *stop,
    )
    cells = grid.state | grid.attempts << 2
    for bit, plane in enumerate((grid.body, grid.inspected, grid.expected, grid.awaited), start=4):
        cells = cells | plane.astype(np.uint8) << bit
    return header + cells.astype(np.uint8).tobytes() + grid.normal.tobytes()


def from_bytes(data: bytes) -> Memory:
    """Raises BadMemory for another length, version, grid, or values that no step can have left behind."""
    if len(data) != LENGTH:
        raise BadMemory(f"a map has {LENGTH} bytes, not {len(data)}")
    magic, version, size, cell_m, cut, relaxed, stuck, stopped, steps, *numbers = _HEADER.unpack_from(data)
    if magic != _MAGIC:
        raise BadMemory("these bytes are no explorer's map")
    if version != VERSION:
        raise BadMemory(f"the map has version {version}; this service reads version {VERSION}")
    if size != SIZE or cell_m != CELL_M:
        raise BadMemory(f"the map has {size} cells of {cell_m:g} m each way; this service's has {SIZE} of {CELL_M:g} m")
    if cut > CUT_LIFTED or stopped > 1:
        raise BadMemory("the map's header holds a value that no step leaves behind")
    if not all(math.isfinite(n) and abs(n) <= _FARTHEST_M for n in numbers):
        raise BadMemory("the map's header holds a place that is not on this earth")
    west, south, x, y, east, north, stop_x, stop_y = numbers
    if not 0.9 < math.hypot(east, north) < 1.1:
        raise BadMemory("the map's first facade has no direction")
    flat = np.frombuffer(data, np.uint8, offset=_HEADER.size)
    cells, normal = flat[: SIZE * SIZE].reshape(SIZE, SIZE), flat[SIZE * SIZE :].reshape(SIZE, SIZE)
    state = (cells & 3).astype(np.uint8)
    expected = (cells & 64) > 0
    if (state > OCCUPIED).any() or (expected & (state != UNKNOWN)).any():
        raise BadMemory("the map holds a cell that no step leaves behind")
    grid = Map(
        west,
        south,
        state=state,
        body=(cells & 16) > 0,
        normal=normal.copy(),
        inspected=(cells & 32) > 0,
        expected=expected,
        attempts=((cells >> 2) & 3).astype(np.uint8),
        awaited=(cells & 128) > 0,
    )
    stop = (stop_x, stop_y) if stopped else None
    return Memory(grid, Seed(x, y, (east, north)), cut, relaxed, stuck, steps, stop)
