"""Streams of server-sent events on their way through: what went by, and one stream for several callers."""

import asyncio
from collections import deque
from collections.abc import AsyncGenerator, Callable
from contextlib import aclosing
from dataclasses import dataclass

from service_kit.running_loop import running_loop
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


class _Reader:
    """One of a broadcast's readers: the number of the piece that it wants next, and where it waits for it."""

    def __init__(self) -> None:
        self.at = 0
        self.cut_off = False
        self.turn: asyncio.Future[None] | None = None

    def wake(self) -> None:
        if self.turn is not None and not self.turn.done():
            self.turn.set_result(None)


class Broadcast:
    """One stream under way and everybody who reads it. Whoever comes late gets what went by first; when the last
    reader leaves, the stream is broken off.

    What went by is held up to MAX_SHARED_BYTES. From there on nobody may join, what all have read is let go, and
    whoever is so far behind that more would be held is cut off; but for the one who has been there longest, for whom
    the stream waits as it would for a single reader."""

    def __init__(self, pieces: Pieces, course: Course, over: Callable[[], object]) -> None:
        """`over` is called when nobody may join any more."""
        self.course = course
        self._held: deque[bytes] = deque()
        self._first = 0  # the number of the first piece that is held
        self._size = 0
        self._joinable = True
        self._ended = False
        self._error: BaseException | None = None
        self._readers: dict[_Reader, None] = {}
        self._read_on = asyncio.Event()
        self._over = over
        self._task = asyncio.create_task(self._pump(pieces))

    async def read(self) -> Pieces:
        """Everything from the beginning. Raises what the stream raised, after all that came before it."""
        reader = _Reader()
        self._readers[reader] = None
        try:
            while True:
                while not reader.cut_off and reader.at < self._first + len(self._held):
                    piece = self._held[reader.at - self._first]
                    reader.at += 1
                    yield piece
                    self._read_on.set()
                if reader.cut_off:
                    raise ModelUnreachable(
                        "this caller was too slow for a stream that it shares with others; ask again"
                    )
                if self._ended:
                    break
                reader.turn = running_loop().create_future()
                await reader.turn
            if self._error is not None:
                raise self._error
        finally:
            del self._readers[reader]
            self._read_on.set()
            if not self._readers and not self._ended:
                self._over()
                self._task.cancel()

    async def _pump(self, pieces: Pieces) -> None:
        try:
            async with aclosing(pieces):
                async for piece in pieces:
                    self._held.append(piece)
                    self._size += len(piece)
                    self._wake()
                    if self._size > MAX_SHARED_BYTES:
                        self._close_to_newcomers()
                        await self._made_room()
        except Exception as error:
            self._error = error
        except asyncio.CancelledError as error:
            self._error = error
            raise
        finally:
            self._ended = True
            self._close_to_newcomers()
            self._wake()

    def _close_to_newcomers(self) -> None:
        if self._joinable:
            self._joinable = False
            self._over()

    async def _made_room(self) -> None:
        """Let go of what all have read. Who keeps the most from that is cut off, or waited for."""
        while True:
            longest_there = next(iter(self._readers), None)
            behind = min(self._readers, key=lambda reader: reader.at, default=None)
            while behind is not None and self._first < behind.at and self._held:
                self._size -= len(self._held.popleft())
                self._first += 1
            if behind is None or self._size <= MAX_SHARED_BYTES:
                return
            if behind is longest_there:
                self._read_on.clear()
                await self._read_on.wait()
            else:
                behind.cut_off = True
                behind.at = self._first + len(self._held)
                behind.wake()

    def _wake(self) -> None:
        for reader in self._readers:
            reader.wake()
