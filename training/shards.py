"""Pictures with their labels on disk: one file a street, whole or not there at all."""

import io
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from training.labels import Labels

Picture = NDArray[np.uint8]
THING = np.dtype(
    [
        ("view", "<u2"),
        ("kind", "<u2"),
        ("colour", "u1"),
        ("goal", "?"),
        ("box", "<f4", 4),
        ("pixels", "<u4"),
        ("share", "<f4"),
        ("distance_m", "<f4"),
    ]
)


class Shard(NamedTuple):
    """`things` are rows of THING; maps are (V, h, w) uint8; `frontal` and `crowded` (V,)."""

    seed: int
    jpegs: tuple[bytes, ...]
    things: NDArray[np.void]
    building: NDArray[np.uint8]
    window: NDArray[np.uint8]
    row: NDArray[np.uint8]
    frontal: NDArray[np.bool_]
    crowded: bool

    def picture(self, view: int) -> Picture:
        """(H, W, 3) RGB."""
        return decoded(self.jpegs[view])


def decoded(jpeg: bytes) -> Picture:
    """(H, W, 3) RGB. Raises ValueError for what is no picture."""
    bgr = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
    if bgr is None:
        raise ValueError("not a JPEG")
    return np.asarray(cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB), np.uint8)


def write(
    path: Path,
    seed: int,
    jpegs: Sequence[bytes],
    labels: Sequence[Labels],
    frontal: Sequence[bool],
    crowded: bool,
) -> None:
    """Under another name first, so that an interrupted run leaves no half file."""
    rows = [
        (view, t.kind, t.colour, t.goal, t.box, t.pixels, t.share, t.distance_m)
        for view, label in enumerate(labels)
        for t in label.things
    ]
    packed = io.BytesIO()
    np.savez_compressed(
        packed,
        about=np.frombuffer(json.dumps({"seed": seed, "crowded": crowded}).encode(), np.uint8),
        jpeg=np.frombuffer(b"".join(jpegs), np.uint8),
        ends=np.cumsum([len(j) for j in jpegs]),
        things=np.array(rows, THING),
        building=np.stack([label.building for label in labels]),
        window=np.stack([label.window for label in labels]),
        row=np.stack([label.row for label in labels]),
        frontal=np.array(frontal, np.bool_),
    )
    part = path.with_suffix(".part")
    part.write_bytes(packed.getvalue())
    part.rename(path)


def read(path: Path) -> Shard:
    """Raises OSError or ValueError for a file that is no shard."""
    with np.load(path) as data:
        about = json.loads(data["about"].tobytes())
        raw, ends = data["jpeg"].tobytes(), [int(e) for e in data["ends"]]
        jpegs = tuple(raw[a:b] for a, b in zip([0, *ends[:-1]], ends, strict=True))
        return Shard(
            int(about["seed"]),
            jpegs,
            data["things"],
            data["building"],
            data["window"],
            data["row"],
            data["frontal"],
            bool(about["crowded"]),
        )


def shard_path(folder: Path, seed: int) -> Path:
    return folder / f"street-{seed:07d}.npz"


def shards(folder: Path) -> Iterator[Path]:
    """Finished files, by seed."""
    yield from sorted(folder.glob("street-*.npz"))


def spread(paths: Sequence[Path], count: int) -> Iterator[Picture]:
    """One picture, (H, W, 3) RGB, of each of `count` shards spread over all of them, of fewer where there are fewer:
    each time another view of its street."""
    for number, path in enumerate(paths[:: max(1, len(paths) // count)][:count]):
        shard = read(path)
        yield shard.picture(number * 5 % len(shard.jpegs))
