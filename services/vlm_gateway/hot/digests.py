"""What a chat's answer is kept under: a hash of everything that says who may have it and what it depends on."""

import json
from collections.abc import Mapping

from blake3 import blake3

from services.vlm_gateway.hot.scan import Scanned
from services.vlm_gateway.keys import Key

FORMAT = b"2"
"""Part of every key; raise it when the form of the stored answers changes."""


class Digests:
    """`fingerprint` is what of the configuration answers depend on; `default` is the alias that answers where a chat
    names none."""

    def __init__(self, fingerprint: Mapping[str, object], default: str) -> None:
        self._default = default
        self._configured = blake3(FORMAT + json.dumps(fingerprint).encode()).digest()
        self._prefixes: dict[Key, blake3] = {}

    def of(self, key: Key, scanned: Scanned) -> str:
        """Of a chat as its caller wrote it."""
        prefix = self._prefixes.get(key)
        if prefix is None:
            may = None if key.models is None else sorted(key.models)
            prefix = blake3(self._configured + json.dumps([key.tenant, may]).encode() + b"\n")
            self._prefixes[key] = prefix
        digest = prefix.copy()
        digest.update(scanned.raw)
        if b'"model"' not in scanned.skeleton:
            digest.update(b"\n" + self._default.encode())
        return digest.hexdigest()
