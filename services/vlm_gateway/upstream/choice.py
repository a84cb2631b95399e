"""Which of a model's servers is asked: the least busy and quickest by its weight, or the one that has seen most of it.

Model servers keep what they computed of a prompt's beginning (prefix cache) and of pictures. A request goes where most
of it was seen before, as long as that server is not much busier than the others: being twice as busy as they are on
average outweighs having seen all of it. What nobody has seen is shared out.
"""

import math
from collections import Counter, OrderedDict
from collections.abc import Collection, Sequence
from typing import NamedTuple

from blake3 import blake3

from services.vlm_gateway.upstream.endpoint import Endpoint
from services.vlm_gateway.upstream.http_reply import Buffer

MAX_MARKS = 32_768
MAX_BOUNDARIES = 64
LEAST_PREFIX_BYTES = 256
FEW = 4.0
"""Up to so many calls at a server, one more or less is no reason to leave the one that has seen a request."""
ALIKE = 1.5
ALIKE_S = 0.02
"""Waits that differ by less than this factor, or latencies by less than these seconds, count as the same."""
_PICTURE = b'"data:image/'
_ROLE = b'"role"'


class Mark(NamedTuple):
    """Something of a request that a server may know: a beginning of it, or one of its pictures. `size` in bytes."""

    digest: bytes
    size: int
    picture: bool


class Affinity:
    """Which server saw what last."""

    def __init__(self) -> None:
        self._seen: OrderedDict[bytes, Endpoint] = OrderedDict()

    def known_bytes(self, marks: Sequence[Mark]) -> Counter[Endpoint]:
        """How much of a request each server has seen: its longest beginning, or its pictures, whichever is more."""
        beginnings, pictures = Counter[Endpoint](), Counter[Endpoint]()
        for mark in marks:
            if (endpoint := self._seen.get(mark.digest)) is None:
                continue
            if mark.picture:
                pictures[endpoint] += mark.size
            else:
                beginnings[endpoint] = max(beginnings[endpoint], mark.size)
        return beginnings | pictures

    def sent(self, marks: Sequence[Mark], endpoint: Endpoint) -> None:
        for mark in marks:
            self._seen[mark.digest] = endpoint
            self._seen.move_to_end(mark.digest)
        while len(self._seen) > MAX_MARKS:
            self._seen.popitem(last=False)


def marks_of(body: Sequence[Buffer]) -> list[Mark]:
    """Its beginnings, up to the ends of messages and pictures, and its pictures."""
    raw = b"".join(body)
    start = max(0, raw.find(b'"messages"'))
    pictures = _pictures(raw, start)
    roles: list[int] = []
    at = start
    while len(roles) <= MAX_BOUNDARIES and (at := raw.find(_ROLE, at + 1)) >= 0:
        roles.append(at)
    marks = [Mark(blake3(raw[begin:end]).digest(16), end - begin, True) for begin, end in pictures]
    hasher, done = blake3(), start
    for boundary in sorted([*roles[1:], *(end for _, end in pictures)]):
        hasher.update(raw[done:boundary])
        done = boundary
        if done - start >= LEAST_PREFIX_BYTES:
            marks.append(Mark(hasher.digest(16), done - start, False))
    return marks


def _pictures(raw: bytes, start: int) -> list[tuple[int, int]]:
    """Where its data URLs begin and end."""
    found: list[tuple[int, int]] = []
    at = start
    while len(found) < MAX_BOUNDARIES and (begin := raw.find(_PICTURE, at)) >= 0:
        at = raw.find(b'"', begin + 1)
        if at < 0:
            break
        found.append((begin, at))
    return found


class EndpointChoice:
    """Over all servers of one model."""

    def __init__(self, endpoints: Sequence[Endpoint], *, affinity: bool) -> None:
        self.endpoints = tuple(endpoints)
        self._affinity = Affinity() if affinity and len(endpoints) > 1 else None
        self._canaries = dict.fromkeys((e for e in endpoints if e.canary), 0.0)

    def marks(self, body: Sequence[Buffer]) -> list[Mark]:
        """Of a request, where they matter."""
        return [] if self._affinity is None else marks_of(body)

    def pick(self, caller: str, marks: Sequence[Mark], tried: Collection[Endpoint] = ()) -> Endpoint | None:
        """The server to ask next for this caller, none of those `tried` where there is another; None where none is to
        be asked."""
        if len(self.endpoints) == 1:
            only = self.endpoints[0]
            return only if only.health.allow(caller) else None
        for group in ([e for e in self.endpoints if e not in tried], list(tried)):
            for endpoint in self._in_order(group, caller, marks):
                if endpoint.health.allow(caller):
                    if self._affinity is not None:
                        self._affinity.sent(marks, endpoint)
                    return endpoint
        return None

    def has_other(self, caller: str, tried: Collection[Endpoint]) -> bool:
        """Whether there is a server that may be asked and was not tried yet."""
        return any(endpoint not in tried and self._open(endpoint, caller) for endpoint in self.endpoints)

    def _open(self, endpoint: Endpoint, caller: str) -> bool:
        return not (endpoint.drained or endpoint.unwell or endpoint.is_busy or endpoint.health.wait_s(caller))

    def _in_order(self, group: Sequence[Endpoint], caller: str, marks: Sequence[Mark]) -> list[Endpoint]:
        open_ = [e for e in group if self._open(e, caller)] or [e for e in group if not e.drained]
        if canary := self._due_canary(open_):
            return [canary, *(e for e in open_ if e is not canary)]
        usual = [e for e in open_ if e.weight and not e.canary] or open_
        quickest = min((latency for e in usual if (latency := e.expected_latency_s())), default=1.0)
        known = self._affinity.known_bytes(marks) if self._affinity is not None and marks else Counter[Endpoint]()
        total = max([mark.size for mark in marks if not mark.picture], default=0)
        total = max(total, sum(mark.size for mark in marks if mark.picture), 1)
        mean = sum(_load(e) for e in usual) / max(1, len(usual))

        def cost(endpoint: Endpoint) -> tuple[float, float, float]:
            # of whom nothing is known may be better than the best, but not so much that all run there
            latency = (endpoint.expected_latency_s() or quickest / 2) + ALIKE_S
            wait = (endpoint.running + 1) * latency * (1 + endpoint.failed_in_a_row) / _weight(endpoint)
            seen = known[endpoint] / total
            busier = (_load(endpoint) - mean) / max(FEW, mean)
            alike = round(
                math.log(wait, ALIKE)
            )  # so that what is new is shared out, not sent after the noise of clocks
            return busier - seen if known else 0.0, alike, endpoint.asked / _weight(endpoint)

        return sorted(usual, key=cost)

    def _due_canary(self, group: Sequence[Endpoint]) -> Endpoint | None:
        """The canary whose share has come up."""
        for endpoint in self._canaries:
            if endpoint not in group:
                continue
            self._canaries[endpoint] += endpoint.canary
            if self._canaries[endpoint] >= 1.0 - 1e-9:
                self._canaries[endpoint] -= 1.0
                return endpoint
        return None


def _weight(endpoint: Endpoint) -> float:
    return max(1e-6, endpoint.weight * endpoint.ramp)


def _load(endpoint: Endpoint) -> float:
    return endpoint.running / _weight(endpoint)
