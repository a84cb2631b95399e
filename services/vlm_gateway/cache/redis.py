"""Answers in Redis, over one connection on which commands follow one another without waiting for replies.

Bounded waits and no retries inside: the guard in front decides what a failure costs.
"""

import asyncio
import random
import ssl
from collections import deque
from collections.abc import AsyncIterator, Mapping
from typing import NamedTuple, cast
from urllib.parse import parse_qs, unquote, urlsplit

from service_kit.settings import BadSetting, without_password
from services.vlm_gateway.cache.port import CacheDown, CacheFull, Entry
from services.vlm_gateway.cache.resp import Refused, Replies, Value, command

PREFIX = b"vlm_gateway:1:"
DEFAULT_PORT = 6379
_SCAN = b"""local page = redis.call('SCAN', ARGV[1], 'MATCH', ARGV[2], 'COUNT', 512)
table.insert(page[2], 1, page[1])
return table.concat(page[2], '\\n')"""
_NO_ROOM = ("OOM", "MISCONF", "READONLY")
_NO_ENTRY = ("NOAUTH", "WRONGPASS", "NOPERM")


class _Place(NamedTuple):
    """Where the server is: `path` of a socket, or `host` and `port`."""

    host: str
    port: int
    path: str
    tls: bool
    user: str
    password: str
    database: int


class RedisCache:
    """`timeout_s` bounds every reply, and making the connection as well. `ttl_s` 0 keeps answers for ever; their
    times are spread by up to a tenth, so that a recorded run does not expire in one moment. How much is held is
    bounded by the server's `maxmemory`."""

    def __init__(self, url: str, *, ttl_s: float, timeout_s: float = 0.04) -> None:
        """Raises BadSetting where `url` is not a Redis address."""
        self._ttl_s = ttl_s
        self._timeout_s = timeout_s
        self._shown = without_password(url)
        self._place = _place(url, self._shown)
        self._line: _Line | None = None
        self._connecting: asyncio.Task[_Line] | None = None

    @property
    def place(self) -> str:
        return self._shown

    async def get(self, key: str) -> bytes | None:
        value = await self.do(b"GET", PREFIX + key.encode())
        return value if isinstance(value, bytes) else None

    async def put(self, answers: Mapping[str, bytes]) -> None:
        line = await self._open()
        replies = [line.ask(command(*self._set(key, value)), self._timeout_s) for key, value in answers.items()]
        refused: CacheDown | None = None
        for reply in replies:
            try:
                await self._read(reply)
            except CacheFull as error:
                refused = error
        if refused is not None:
            raise refused

    def _set(self, key: str, value: bytes) -> list[bytes]:
        words = [b"SET", PREFIX + key.encode(), value]
        if self._ttl_s > 0:
            words += [b"PX", str(max(1, int(self._ttl_s * 1000 * random.uniform(0.9, 1.0)))).encode()]
        return words

    async def entries(self) -> AsyncIterator[Entry]:
        """Walks with SCAN, inside a script, since its own reply is of a kind that nothing else here needs."""
        cursor = b"0"
        while True:
            page = await self.do(b"EVAL", _SCAN, b"0", cursor, PREFIX + b"*")
            if not isinstance(page, bytes):
                raise CacheDown(f"{self._shown} can't be walked through")
            cursor, *names = page.split(b"\n")
            for name in names:
                value = await self.do(b"GET", name)
                if isinstance(value, bytes):
                    yield Entry(name.removeprefix(PREFIX).decode("ascii", "replace"), value)
            if cursor == b"0":
                return

    async def ping(self) -> None:
        await self.do(b"PING")

    async def close(self) -> None:
        if self._connecting is not None:
            self._connecting.cancel()
            await asyncio.gather(self._connecting, return_exceptions=True)
        if self._line is not None:
            self._line.lost(CacheDown(f"{self._shown} is closed"))
            self._line = None

    async def do(self, *words: bytes) -> Value:
        line = await self._open()
        return await self._read(line.ask(command(*words), self._timeout_s))

    async def _open(self) -> "_Line":
        line = self._line
        return await self._connected() if line is None or line.closed else line

    async def _read(self, reply: "asyncio.Future[Value]") -> Value:
        try:
            value = await reply
        except ConnectionError as error:
            raise CacheDown(f"{self._shown} {error}") from None
        if isinstance(value, Refused):
            raise self._refusal(value)
        return value

    async def _connected(self) -> "_Line":
        """The connection, made once for all who wait for it. Raises CacheDown."""
        if self._connecting is None:
            self._connecting = asyncio.create_task(self._connect())
            self._connecting.add_done_callback(self._arrived)
        try:
            return await asyncio.shield(self._connecting)
        except asyncio.CancelledError:
            task = asyncio.current_task()
            if task is not None and task.cancelling():
                raise
            raise CacheDown(f"{self._shown} is closed") from None

    def _arrived(self, task: "asyncio.Task[_Line]") -> None:
        self._connecting = None
        if not task.cancelled() and task.exception() is None:
            self._line = task.result()

    async def _connect(self) -> "_Line":
        loop = asyncio.get_running_loop()
        place = self._place
        tls = ssl.create_default_context() if place.tls else None
        try:
            async with asyncio.timeout(self._timeout_s):
                if place.path:
                    _, line = await loop.create_unix_connection(_Line, place.path)
                else:
                    _, line = await loop.create_connection(_Line, place.host, place.port, ssl=tls)
        except TimeoutError:
            raise CacheDown(f"{self._shown} does not answer within {self._timeout_s * 1000:g} ms") from None
        except OSError as error:
            raise CacheDown(f"{self._shown} can't be reached ({type(error).__name__})") from None
        greetings = []
        if place.password:
            greetings.append(command(b"AUTH", *([place.user.encode()] if place.user else []), place.password.encode()))
        if place.database:
            greetings.append(command(b"SELECT", str(place.database).encode()))
        for reply in [line.ask(greeting, self._timeout_s) for greeting in greetings]:
            try:
                value = await reply
            except ConnectionError as error:
                raise CacheDown(f"{self._shown} {error}") from None
            if isinstance(value, Refused):
                line.lost(ConnectionError("was left"))
                raise self._refusal(value)
        return line

    def _refusal(self, refused: Refused) -> CacheDown:
        word = refused.message.split(" ", 1)[0]
        if word in _NO_ROOM:
            return CacheFull(f"{self._shown} has no memory left or takes no writes ({word})")
        if word in _NO_ENTRY or "password" in refused.message:
            return CacheDown(f"{self._shown} refuses the password")
        return CacheDown(f"{self._shown} can't be used ({word})")


class _Asked(NamedTuple):
    """A command under way; `due` is of the event loop's clock."""

    reply: "asyncio.Future[Value]"
    due: float
    timeout_s: float


class _Line(asyncio.Protocol):
    """One connection: commands go out together once a turn of the event loop, replies come back in their order."""

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._transport: asyncio.Transport | None = None
        self._waiting: deque[_Asked] = deque()
        self._timer: asyncio.TimerHandle | None = None
        self._unsent: list[bytes] = []
        self._replies = Replies()
        self.closed = False

    def ask(self, words: bytes, timeout_s: float) -> "asyncio.Future[Value]":
        """The reply to come, which may be a Refused. Raises ConnectionError where none does."""
        reply: asyncio.Future[Value] = self._loop.create_future()
        if self.closed:
            reply.set_exception(ConnectionError("closed the connection"))
            return reply
        if not self._unsent:
            self._loop.call_soon(self._send)
        self._unsent.append(words)
        self._waiting.append(_Asked(reply, self._loop.time() + timeout_s, timeout_s))
        if self._timer is None:
            self._timer = self._loop.call_later(timeout_s, self._look)
        return reply

    def lost(self, why: Exception) -> None:
        """The connection is over, and with it all that was asked on it."""
        self.closed = True
        if self._transport is not None:
            self._transport.abort()
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        while self._waiting:
            reply = self._waiting.popleft().reply
            if not reply.done():
                reply.set_exception(why)
                reply.exception()  # whoever asked may have left

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.Transport, transport)

    def connection_lost(self, error: Exception | None) -> None:
        self.lost(ConnectionError("closed the connection"))

    def data_received(self, data: bytes) -> None:
        try:
            values = self._replies.feed(data)
        except ValueError:
            self.lost(ConnectionError("is no Redis"))
            return
        for value in values:
            if not self._waiting:
                self.lost(ConnectionError("is no Redis"))
                return
            reply = self._waiting.popleft().reply
            if not reply.done():
                reply.set_result(value)

    def _send(self) -> None:
        unsent, self._unsent = self._unsent, []
        if not self.closed and self._transport is not None:
            self._transport.writelines(unsent)

    def _look(self, overdue: "asyncio.Future[Value] | None" = None, looks: int = 0) -> None:
        """Whether the reply that is waited for longest is late; one timer serves all. This process may be the one that
        was late, so replies that lie on the socket are read first."""
        self._timer = None
        if not self._waiting or self.closed:
            return
        first = self._waiting[0]
        if (left_s := first.due - self._loop.time()) > 0:
            self._timer = self._loop.call_later(left_s, self._look)
        elif first.reply is not overdue or looks < 2:
            looks = looks + 1 if first.reply is overdue else 1
            self._timer = self._loop.call_later(0.001, self._look, first.reply, looks)
        else:
            self.lost(ConnectionError(f"does not answer within {first.timeout_s * 1000:g} ms"))


def _place(url: str, shown: str) -> _Place:
    parts = urlsplit(url)
    try:
        port = parts.port or DEFAULT_PORT
        in_path = parts.path.strip("/") if parts.scheme != "unix" else parse_qs(parts.query).get("db", [""])[0]
        database = int(in_path or 0)
        if parts.scheme not in ("redis", "rediss", "unix") or not (
            parts.path if parts.scheme == "unix" else parts.netloc
        ):
            raise ValueError("no Redis address")
    except ValueError as error:
        raise BadSetting(f"REDIS_URL={shown}: {error}; give redis://host:6379/0") from None
    return _Place(
        host=parts.hostname or "127.0.0.1",
        port=port,
        path=parts.path if parts.scheme == "unix" else "",
        tls=parts.scheme == "rediss",
        user=unquote(parts.username or ""),
        password=unquote(parts.password or ""),
        database=database,
    )
