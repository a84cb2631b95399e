"""JSON as model servers write it."""

import json
from codecs import BOM_UTF8
from typing import Any

from jiter import from_json


def parsed(data: bytes, *, allow_inf_nan: bool = False) -> Any:
    """What `data` says, a byte order mark in front of it or not. Half a character (`"\\ud83d"`: answers are cut between
    tokens, and Python's json writes what is left of it) is read as `?`. Raises ValueError where it is no JSON."""
    try:
        return from_json(data, allow_inf_nan=allow_inf_nan)
    except ValueError:
        if data.startswith(BOM_UTF8):
            return parsed(data.removeprefix(BOM_UTF8), allow_inf_nan=allow_inf_nan)
        if b"\\ud" not in data and b"\\uD" not in data:
            raise
    try:
        said = json.loads(data, parse_constant=None if allow_inf_nan else _refused)
        return json.loads(json.dumps(said, ensure_ascii=False).encode("utf-8", "replace"))
    except RecursionError:
        raise ValueError("nested too deeply") from None


def _refused(name: str) -> None:
    raise ValueError(f"{name} is no JSON")
