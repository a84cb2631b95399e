"""What a flight came to, without what a clock or a cache says: the same answers give the same outcome again."""

import hashlib
import json
from collections.abc import Iterable, Mapping
from typing import Any

from evaluation.metrics.episode import EpisodeRecord

_DIGITS = 6
"""Metres and radians are the same to a micrometre."""
_OF_RESULT = {"timings_s", "renderer", "message", "model_calls"}
_OF_CALLS = ("calls", "unreadable", "refused", "unreachable")


def outcome(record: EpisodeRecord) -> dict[str, Any]:
    """By dotted names: reason, verdict, steps, way, height and stops, and what was asked of each role."""
    told: dict[str, Any] = {"task": record.task, "reason": record.reason}
    if record.result is not None:
        told |= record.result.model_dump(mode="json", exclude=_OF_RESULT)
        calls = record.result.model_calls
        told["model_calls"] = {role: {n: getattr(c, n) for n in _OF_CALLS} for role, c in sorted(calls.items())}
    return dict(_flat("", told))


def digest(records: Iterable[EpisodeRecord]) -> str:
    """A SHA-256 of all outcomes, in whatever order they were flown: two runs that flew alike have the same."""
    told = sorted((outcome(record) for record in records), key=lambda fields: str(fields["task"]))
    lines = (json.dumps(fields, sort_keys=True, ensure_ascii=False, separators=(",", ":")) for fields in told)
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()


def differing(claimed: EpisodeRecord, replayed: EpisodeRecord) -> dict[str, str]:
    """The names in which two outcomes differ, and how: claimed, then replayed."""
    there, here = outcome(claimed), outcome(replayed)
    names = sorted(there.keys() | here.keys())
    return {
        name: f"{there.get(name, 'none')} and {here.get(name, 'none')}"
        for name in names
        if there.get(name) != here.get(name)
    }


def _flat(prefix: str, value: Any) -> Iterable[tuple[str, Any]]:
    if isinstance(value, Mapping):
        for name, part in value.items():
            yield from _flat(f"{prefix}.{name}" if prefix else str(name), part)
    elif isinstance(value, list | tuple):
        for number, part in enumerate(value):
            yield from _flat(f"{prefix}.{number}", part)
    else:
        # -0.0 and 0.0 are one place
        yield prefix, round(value, _DIGITS) + 0.0 if isinstance(value, float) else value
