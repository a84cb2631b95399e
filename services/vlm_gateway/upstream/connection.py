"""One HTTP/1.1 connection and the exchange on it: what comes is a whole reply, or a stream of pieces, or is broken.

Parsing is llhttp's (through httptools). What is ours is what the end of a connection means for a reply, and that
nothing waits or grows without a bound.
"""

import asyncio
import select
from collections.abc import Awaitable, Sequence
from typing import Protocol, cast

import httptools

from service_kit.running_loop import running_loop
from services.vlm_gateway.upstream.http_reply import BrokenReply, Buffer, Reply, Stream

MAX_HEAD_BYTES = 64 * 1024
HIGH_WATER_BYTES = 256 * 1024
"""A stream whose reader is slower than the server is not read beyond this."""


class Home(Protocol):
    """Who keeps the connection between exchanges: told when it opens, is lost, and may be used again."""

    def opened(self, connection: "Connection") -> None: ...
    def left(self, connection: "Connection") -> None: ...
    def back(self, connection: "Connection") -> None: ...


class Connection(asyncio.Protocol):
    """One connection and the one exchange on it. Afterwards it goes back to its pool, or it is closed."""

    def __init__(self, home: Home) -> None:
        self._home = home
        self._loop = running_loop()
        self._transport: asyncio.Transport | None = None
        self._parser = httptools.HttpResponseParser(self)
        self._max_bytes: int | None = None
        self._waiter: asyncio.Future[Reply | None] | None = None
        self._due = 0.0
        self._timer: asyncio.TimerHandle | None = None
        self._broken: BrokenReply | None = None
        self._busy = False
        self._paused = False
        self._unsent = False
        self._poll = select.poll()
        self.idle_since = 0.0
        self._begin()

    def _begin(self) -> None:
        self.status = 0
        self.headers: dict[bytes, bytes] = {}
        self._head_seen = False
        self._complete = False
        self._reusable = False
        self._until_end = False
        self._head_bytes = 0
        self._size = 0
        self._pieces: list[bytes] = []

    # -- what the pool and the stream ask for

    def send(self, request: Sequence[Buffer], deadline: float, max_bytes: int | None) -> Awaitable[Reply | None]:
        """The whole reply, or without `max_bytes` nothing, once the head of a `stream` has come. Raises BrokenReply."""
        assert self._transport is not None
        self._begin()
        self._busy = True
        self._max_bytes = max_bytes
        self._unsent = False
        self._transport.writelines(request)
        return self._wait(deadline)

    def stream(self) -> Stream:
        """The reply whose head has come."""
        return Stream(self, self.status, self.headers)

    async def piece(self, deadline: float) -> bytes:
        while not self._pieces and not self._complete:
            await self._wait(deadline)
        return self.taken()

    def taken(self) -> bytes:
        """What has come of the body since it was asked for last."""
        pieces, self._pieces = self._pieces, []
        if self._paused and self._transport is not None:
            self._paused = False
            self._size = 0
            self._transport.resume_reading()
        elif self._max_bytes is None:
            self._size = 0
        return pieces[0] if len(pieces) == 1 else b"".join(pieces)

    def release(self) -> None:
        """The exchange is over: back to the pool, or closed where something of it is still to come."""
        self._busy = False
        if self._complete and self._reusable and not self.is_closing():
            self.idle_since = self._loop.time()
            self._home.back(self)
        else:
            self.leave()

    def is_closing(self) -> bool:
        return self._transport is None or self._transport.is_closing()

    def is_fresh(self, within_s: float) -> bool:
        """Whether a connection between two exchanges can still be used: it has not been idle for longer. What the
        server did to it since the loop last looked at its socket counts too: it mustn't be found out by a request that
        can't be sent again."""
        transport = self._transport
        return (
            transport is not None
            and not transport.is_closing()
            and self._loop.time() - self.idle_since < within_s
            and not self._poll.poll(0)
        )

    def leave(self) -> None:
        """Close at once, whatever is under way."""
        self._home.left(self)
        self._forget()
        if self._transport is not None:
            self._transport.abort()

    async def _wait(self, deadline: float) -> Reply | None:
        """Until something has come: the whole reply where that was asked for."""
        if self._broken is not None:
            raise self._broken
        waiter: asyncio.Future[Reply | None] = self._loop.create_future()
        self._waiter = waiter
        self._due = deadline
        if self._timer is None or self._timer.when() > deadline:
            self._remind(deadline)
        try:
            return await waiter
        except BaseException:
            if self._waiter is waiter:
                self.leave()  # cancelled or broken: the rest of this exchange must not meet the next one
            raise
        finally:
            if self._waiter is waiter:  # after a whole reply somebody else may wait here already
                self._waiter = None

    def _wake(self, reply: Reply | None = None) -> None:
        if self._waiter is not None and not self._waiter.done():
            self._waiter.set_result(reply)

    def _forget(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _remind(self, at: float) -> None:
        if self._timer is not None:
            self._timer.cancel()
        self._timer = self._loop.call_at(at, self._look)

    def _look(self) -> None:
        """Whether what is waited for is late. The timer outlives the exchange it was set for: most are over long before
        their deadline, and timers are dear."""
        self._timer = None
        if self._waiter is None or self._waiter.done():
            return
        if self._loop.time() < self._due:
            self._remind(self._due)
        else:
            self._fail(BrokenReply("late", "no reply in time"))

    def _fail(self, broken: BrokenReply) -> None:
        self._broken = self._broken or broken
        if self._waiter is not None and not self._waiter.done():
            self._waiter.set_exception(self._broken)
        self.leave()

    # -- what the transport tells

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.Transport, transport)
        self._transport.set_write_buffer_limits(high=0)  # so that `resume_writing` says when all is on its way
        self._poll.register(transport.get_extra_info("socket").fileno(), select.POLLIN)
        self._home.opened(self)

    def data_received(self, data: bytes) -> None:
        if not self._busy or self._complete:
            self.leave()  # nobody asked: no reply of ours can follow on this connection
            return
        if not self._head_seen:
            self._head_bytes += len(data)
        try:
            self._parser.feed_data(data)
        except (httptools.HttpParserError, httptools.HttpParserUpgrade) as error:
            ours = error.__context__  # what one of the callbacks below raised
            if self._max_bytes is None and self._pieces:
                self._pass_on()  # what came before it
            if self._complete:
                self._reusable = False  # something behind a whole reply: that reply stands, the connection doesn't
                self.leave()
            else:
                self._fail(ours if isinstance(ours, BrokenReply) else BrokenReply("garbage", "the reply is not HTTP"))
        else:
            if self._max_bytes is None and self._pieces:
                self._pass_on()
            if self._complete and self._max_bytes is not None:
                self.release()  # only now: all of these bytes were the reply's; a stream is released by its reader
            elif not self._head_seen and self._head_bytes > MAX_HEAD_BYTES:
                self._fail(BrokenReply("too_large", f"the reply's head is over {MAX_HEAD_BYTES} bytes"))

    def _pass_on(self) -> None:
        """Tell a stream's reader, and read no more than it takes."""
        if self._size > HIGH_WATER_BYTES and not self._paused and self._transport is not None:
            self._paused = True
            self._transport.pause_reading()
        self._wake()

    def pause_writing(self) -> None:
        self._unsent = True

    def resume_writing(self) -> None:
        self._unsent = False

    def eof_received(self) -> bool:
        return False  # and with that the transport closes and connection_lost tells

    def connection_lost(self, error: Exception | None) -> None:
        self._home.left(self)
        self._forget()
        if not self._busy or self._complete:
            return
        if self._until_end and self._head_seen and error is None:
            self._finish()
            self._busy = False
        elif self._head_bytes == 0 and self._unsent:
            self._fail(BrokenReply("not_sent", "the connection ended before the request was through"))
        elif self._head_bytes == 0:
            self._fail(BrokenReply("no_reply", "the connection ended before a reply"))
        else:
            self._fail(BrokenReply("cut", "the reply broke off"))

    # -- what the parser tells

    def on_message_begin(self) -> None:
        if self._complete:
            raise BrokenReply("garbage", "there is more than one reply")

    def on_header(self, name: bytes, value: bytes) -> None:
        if not self._head_seen:
            self.headers[name.lower()] = value

    def on_headers_complete(self) -> None:
        self.status = self._parser.get_status_code()
        if self.status < 200:
            return  # 100 and 103 announce a reply; on_message_complete clears them away
        if self._head_bytes > MAX_HEAD_BYTES + HIGH_WATER_BYTES:
            raise BrokenReply("too_large", f"the reply's head is over {MAX_HEAD_BYTES} bytes")
        if self.headers.get(b"content-encoding", b"identity").lower() not in (b"identity", b""):
            raise BrokenReply("garbage", "the reply is compressed, which was not asked for")
        self._head_seen = True
        framed = b"content-length" in self.headers or b"transfer-encoding" in self.headers
        self._until_end = not framed and self.status not in (204, 304)
        if self._max_bytes is None:
            self._wake()

    def on_body(self, body: bytes) -> None:
        self._pieces.append(body)
        self._size += len(body)
        if self._max_bytes is not None and self._size > self._max_bytes:
            raise BrokenReply("too_large", f"the reply is over {self._max_bytes} bytes")

    def on_message_complete(self) -> None:
        if self.status < 200:
            self.headers = {}
            self._head_bytes = 1  # a reply has begun: its loss is no stale connection's
            return
        self._finish()

    def _finish(self) -> None:
        self._complete = True
        transport = self._transport
        # a reply that came before the request was through (413, 401) leaves half a request on the line
        self._reusable = (
            transport is not None
            and not self._until_end
            and self._parser.should_keep_alive()
            and transport.get_write_buffer_size() == 0
            and not transport.is_closing()
        )
        # the reply is handed over here: by the time its reader runs, the connection may serve somebody else
        self._wake(None if self._max_bytes is None else Reply(self.status, self.headers, self.taken()))
