"""Bounds on what all callers of one server may hold together: connections, and bytes of request bodies.

Who goes first where a bound is reached:
  connections    the one that has waited longest without a request under way is closed for the newcomer; where every
                 connection has one, the newcomer is refused with 503
  body bytes     the unfinished body that has stood still longest (for a second at least) is refused with 503; where all
                 are coming in, the one that went over the bound
"""

import asyncio
import fcntl
import resource
import sys
import termios
from typing import NamedTuple, Protocol

from service_kit.hosts import Hosts

STOOD_STILL_S = 1.0
MAX_FRAMING_BYTES = 64 * 1024
FRAMING_A_BODY_BYTE = 8
"""A body may come in chunks of one byte."""
_FILES_FOR_OTHERS = 256
"""File descriptors left for connections to model servers, caches and files."""


class ConnectionLimits(NamedTuple):
    """`head_within_s`: from the first byte (of a new connection: from its opening) to the end of a request's head.
    `body_within_s`: from there to the end of its body. `write_within_s`: how long a caller may take nothing of an
    answer that waits for it. `keep_alive_s`: how long a connection may stay unused."""

    max_connections: int
    head_within_s: float = 15.0
    body_within_s: float = 30.0
    write_within_s: float = 10.0
    keep_alive_s: int = 30
    max_body_bytes_held: int = 512 * 1024 * 1024


def default_limits() -> ConnectionLimits:
    """As many connections as the process may have files open, less a reserve; at most 10,000."""
    soft, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    files = 10_000 if soft == resource.RLIM_INFINITY else soft
    return ConnectionLimits(max_connections=max(16, min(10_000, files - _FILES_FOR_OTHERS)))


class Framing:
    """The bytes of a request that are not its body: its head, the sizes and extensions of chunks, trailers. Told of
    every piece of what came that does not end the request. `came` is set to None where a request begins in the piece
    that is being read."""

    def __init__(self) -> None:
        self.came: int | None = None

    def too_much(self, size: int, body: int) -> bool:
        """Whether it is, with this piece of `size` bytes, of `body` bytes of body so far. The piece in which the
        request began may hold others before it."""
        self.came = came = body if self.came is None else self.came + size
        return came - body > MAX_FRAMING_BYTES + FRAMING_A_BODY_BYTE * body


class Held(Protocol):
    """A connection, as far as the bounds look at it. `body_stands_since` is None unless a body is coming in."""

    @property
    def body_stands_since(self) -> float | None: ...
    def give_way(self) -> None: ...
    def refuse_body(self) -> None: ...


class OpenConnections:
    """All connections of one server, in one event loop."""

    def __init__(self, limits: ConnectionLimits, hosts: Hosts | None = None) -> None:
        """`hosts`: by which names callers may call the server; by any without it."""
        self.limits = limits
        self.hosts = hosts
        self.body_bytes = 0
        self.turned_away = 0
        self._open: set[Held] = set()
        self._idle: dict[Held, None] = {}  # in the order in which they became idle

    def __len__(self) -> int:
        return len(self._open)

    def opened(self, connection: Held) -> bool:
        """Whether the newcomer may stay."""
        if len(self._open) >= self.limits.max_connections:
            self.turned_away += 1
            longest_idle = next(iter(self._idle), None)
            if longest_idle is None:
                return False
            self.closed(longest_idle)
            longest_idle.give_way()
        self._open.add(connection)
        self._idle[connection] = None
        return True

    def closed(self, connection: Held) -> None:
        self._open.discard(connection)
        self._idle.pop(connection, None)

    def busy(self, connection: Held) -> None:
        """A request is under way on it."""
        self._idle.pop(connection, None)

    def idle(self, connection: Held) -> None:
        """Its last request has its answer."""
        if connection in self._open:
            self._idle[connection] = None

    def body_came(self, connection: Held, size: int, now: float) -> None:
        """`size` bytes of a body more are held; somebody is refused where that is too much."""
        self.body_bytes += size
        if self.body_bytes > self.limits.max_body_bytes_held:
            self._who_goes(connection, now).refuse_body()

    def body_gone(self, size: int) -> None:
        self.body_bytes -= size

    def _who_goes(self, last: Held, now: float) -> Held:
        standing = [(since, id(one), one) for one in self._open if (since := one.body_stands_since) is not None]
        since, _, longest = min(standing, default=(now, 0, last))
        return longest if now - since >= STOOD_STILL_S else last


def unread_bytes(transport: asyncio.Transport) -> int:
    """How much of what was written its reader has not taken: what waits here, and what the kernel holds, which may be
    megabytes."""
    held = transport.get_write_buffer_size()
    line = transport.get_extra_info("socket")
    if line is None:
        return held
    try:
        return held + int.from_bytes(fcntl.ioctl(line.fileno(), termios.TIOCOUTQ, bytes(4)), sys.byteorder)
    except OSError:
        return held
