"""The key of an answer: a hash of everything that the answer depends on."""

import hashlib
import json
from collections.abc import Mapping, Sequence

FORMAT = 1
"""Part of every key; raise it when the form of the stored answers changes."""


def answer_key(parts: Mapping[str, object], blobs: Sequence[bytes] = ()) -> str:
    """sha256 (hex) over `parts` as canonical JSON and the bytes of each of `blobs`, in order.

    Every part is preceded by its length, so that no two different questions run together. `parts` holds JSON values.
    """
    head = json.dumps(parts, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False).encode()
    digest = hashlib.sha256(f"{FORMAT}:{len(head)}:".encode())
    digest.update(head)
    for blob in blobs:
        digest.update(f":{len(blob)}:".encode())
        digest.update(blob)
    return digest.hexdigest()
