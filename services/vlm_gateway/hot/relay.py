"""Streams of server-sent events on their way through: what went by, and one stream for several callers."""

import asyncio
from collections.abc import AsyncGenerator, Callable
from contextlib import aclosing
from dataclasses import dataclass

from services.vlm_gateway.cache.guard import MAX_VALUE_BYTES
from services.vlm_gateway.errors import ModelUnreachable
from services.vlm_gateway.upstream.replies import Spent

MAX_SHARED_BYTES = 8 * 1024 * 1024

NOTHING = Spent()
Pieces = AsyncGenerator[bytes, None]


@dataclass(slots=True)
class Course:
    """What became of a streamed call so far: which model answers, and once it ended, how, and what it used."""

    alias: str
    outcome: str = "unfinished"
    used: Spent = NOTHING


class Relayed:
    """What was passed on of a stream, where that is small enough to be kept."""

    def __init__(self) -> None:
        self._pieces: list[bytes] = []
        self._size = 0

    def add(self, piece: bytes) -> None:
        self._size += len(piece)
        if self._size <= MAX_VALUE_BYTES:
            self._pieces.append(piece)
        else:
            self._pieces.clear()

    @property
    def whole(self) -> bytes | None:
        """All of it; None where it was too large."""
        return b"".join(self._pieces) if self._size <= MAX_VALUE_BYTES else None


class Broadcast:
    """One stream under way and everybody who reads it. Whoever comes late gets what went by first; when the last
    reader leaves, the stream is broken off."""

    def __init__(self, pieces: Pieces, course: Course, over: Callable[[], object]) -> None:
        """`over` is called when nobody may join any more."""
        self.course = course
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
            async with aclosing(pieces):
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
