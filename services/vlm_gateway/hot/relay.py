"""Streams of server-sent events on their way through: what went by, and one stream for several callers."""

import asyncio
import re
from collections.abc import AsyncGenerator, Callable

from pydantic_core import from_json

from services.vlm_gateway.cache.guard import MAX_VALUE_BYTES
from services.vlm_gateway.errors import ModelUnreachable
from services.vlm_gateway.upstream.replies import Spent, tokens_of

_ENDS = (b"\ndata: [DONE]", b"\ndata:[DONE]")
_TOLD_WHY = re.compile(rb'"finish_reason"\s*:\s*"[^\n]*\n\r?\n')
"""An event, whole, that says why the answer is over: `transformers serve` sends it and no [DONE]. Where a body says how
long it is, one that was cut is an error all the same."""
_TAIL_BYTES = 2048
_SPOILT = re.compile(rb'"finish_reason"\s*:\s*"(?!stop"|tool_calls"|function_call")|\ndata:\s*\{"error"')
MAX_SHARED_BYTES = 8 * 1024 * 1024

Pieces = AsyncGenerator[bytes, None]


class Kept:
    """What went by of a stream: whether its end was seen, what it cost, and all of it where that is small enough to
    keep."""

    def __init__(self) -> None:
        self.finished = False
        self._pieces: list[bytes] | None = []
        self.size = 0
        self._events = 0
        self._tail = b"\n"

    def add(self, piece: bytes) -> None:
        self._tail = (self._tail + piece)[-_TAIL_BYTES:]
        self.finished = (
            self.finished or any(end in self._tail for end in _ENDS) or _TOLD_WHY.search(self._tail) is not None
        )
        self._events += piece.count(b"\n\n")
        self.size += len(piece)
        if self.size > MAX_VALUE_BYTES:
            self._pieces = None
        if self._pieces is not None:
            self._pieces.append(piece)

    @property
    def whole(self) -> bytes | None:
        return b"".join(self._pieces) if self.finished and self._pieces is not None else None

    @property
    def clean(self) -> bool:
        """Whether it ended as an answer does: not cut by a limit or a filter, no error in it."""
        return _SPOILT.search(self._tail) is None

    def tokens(self) -> Spent:
        """The server's own count where the last events have it; else one token of the answer an event."""
        for line in reversed(self._tail.split(b"\n")):
            if line.startswith(b"data:") and b'"usage"' in line:
                try:
                    event = from_json(line[5:])
                except ValueError:
                    continue
                if isinstance(event, dict) and isinstance(event.get("usage"), dict):
                    return tokens_of(event["usage"])
        return Spent(completion=max(0, self._events - 2))


class Broadcast:
    """One stream under way and everybody who reads it. Whoever comes late gets what went by first; when the last
    reader leaves, the stream is broken off."""

    def __init__(self, pieces: Pieces, over: Callable[[], object]) -> None:
        """`over` is called when nobody may join any more."""
        self._so_far: list[bytes] = []
        self._size = 0
        self._ended = False
        self._error: BaseException | None = None
        self._readers = 0
        self._waiting: set[asyncio.Future[None]] = set()
        self._over = over
        self._task = asyncio.create_task(self._pump(pieces))

    async def read(self) -> Pieces:
        """Everything from the beginning. Raises what the stream raised, after all that came before it."""
        self._readers += 1
        at = 0
        try:
            while True:
                while at < len(self._so_far):
                    at += 1
                    yield self._so_far[at - 1]
                if self._ended:
                    break
                turn: asyncio.Future[None] = asyncio.get_running_loop().create_future()
                self._waiting.add(turn)
                try:
                    await turn
                finally:
                    self._waiting.discard(turn)
            if self._error is not None:
                raise self._error
        finally:
            self._readers -= 1
            if self._readers == 0 and not self._ended:
                self._over()
                self._task.cancel()

    async def _pump(self, pieces: Pieces) -> None:
        try:
            async for piece in pieces:
                self._so_far.append(piece)
                self._size += len(piece)
                if self._size > MAX_SHARED_BYTES:
                    raise ModelUnreachable(f"the stream is over {MAX_SHARED_BYTES} bytes")
                self._wake()
        except Exception as error:
            self._error = error
        except asyncio.CancelledError as error:
            self._error = error
            raise
        finally:
            self._ended = True
            self._over()
            self._wake()

    def _wake(self) -> None:
        for turn in self._waiting:
            if not turn.done():
                turn.set_result(None)
