"""What of a chat request's headers counts."""

import re
from collections.abc import Iterable
from typing import NamedTuple

from service_kit.errors import BadQuestion
from services.vlm_gateway.hot.deadline import stated_timeout_s
from services.vlm_gateway.tracking import request_id_of

_TRACEPARENT = re.compile(rb"00-[0-9a-f]{32}-[0-9a-f]{16}-[0-9a-f]{2}")
_CACHE_HEADER = {b"on": True, b"off": False}
Header = tuple[bytes, bytes]


class Head(NamedTuple):
    """What of a request's headers counts. `cache` is None where the caller leaves it to us; `origin` is a web page's,
    None where a program asks."""

    authorization: bytes | None
    kind: bytes | None
    encoding: bytes | None
    origin: bytes | None
    host: bytes | None
    length: int
    cache_said: bytes | None
    timeout_said: bytes | None
    trace: bytes | None
    request_id: bytes

    @property
    def cache(self) -> bool | None:
        """Raises BadQuestion."""
        if self.cache_said is None:
            return None
        if self.cache_said not in _CACHE_HEADER:
            raise BadQuestion("x-cache: say on or off, or leave it out")
        return _CACHE_HEADER[self.cache_said]

    @property
    def timeout_s(self) -> float | None:
        """Raises BadQuestion."""
        return stated_timeout_s(self.timeout_said)


def head_of(headers: Iterable[Header]) -> Head:
    """Names are in lower case. What is written wrongly is found when it is used."""
    found = dict(headers)
    authorization = found.get(b"authorization")
    if authorization is None and (key := found.get(b"x-api-key")) is not None:
        authorization = b"Bearer " + key  # as Anthropic's clients send it
    length = found.get(b"content-length", b"0")
    trace = found.get(b"traceparent")
    return Head(
        authorization,
        found.get(b"content-type"),
        found.get(b"content-encoding"),
        found.get(b"origin"),
        found.get(b"host"),
        int(length) if length.isdigit() else 0,
        found.get(b"x-cache"),
        found.get(b"x-timeout-s"),
        trace if trace is not None and _TRACEPARENT.fullmatch(trace) else None,
        request_id_of(found.get(b"x-request-id")),
    )
