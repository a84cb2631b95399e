"""What an exchange with a model's server brings: a whole reply, a stream of pieces, or neither.

BrokenReply               nothing usable came; `reason` says what went wrong
  connect      no connection (refused, unknown name, TLS)
  not_sent     the connection ended before all of the request was on its way
  no_reply     ... after that, before the first byte of a reply: the server may have read it
  cut          ... in the middle of one
  garbage      what came is not HTTP/1.1, or in an encoding that was not asked for
  too_large    the head or the body is over its bound
  late         the deadline passed
"""

from typing import NamedTuple, Protocol

Buffer = bytes | memoryview


class BrokenReply(Exception):
    def __init__(self, reason: str, what: str) -> None:
        super().__init__(what)
        self.reason = reason


class Reply(NamedTuple):
    """Header names are in lower case; of repeated headers the last one counts."""

    status: int
    headers: dict[bytes, bytes]
    body: bytes


class Source(Protocol):
    """Where a stream's pieces come from."""

    async def piece(self, deadline: float) -> bytes: ...
    def release(self) -> None: ...


class Stream:
    """A reply whose head has come. Read `piece()` until it is empty, or `close()` to break it off."""

    def __init__(self, connection: Source, status: int, headers: dict[bytes, bytes]) -> None:
        self._connection = connection
        self._over = False
        self.status = status
        self.headers = headers

    async def piece(self, deadline: float) -> bytes:
        """What has come since, at least one byte; empty at the reply's end. Raises BrokenReply."""
        if self._over:
            return b""
        piece = await self._connection.piece(deadline)
        if not piece:
            self._over = True
            self._connection.release()
        return piece

    async def rest(self, deadline: float, max_bytes: int) -> bytes:
        """All that is left. Raises BrokenReply."""
        pieces, size = [], 0
        while piece := await self.piece(deadline):
            pieces.append(piece)
            size += len(piece)
            if size > max_bytes:
                self.close()
                raise BrokenReply("too_large", f"the reply is over {max_bytes} bytes")
        return b"".join(pieces)

    def close(self) -> None:
        """Let go of the connection; it is kept for others where the reply had ended."""
        if not self._over:
            self._over = True
            self._connection.release()
