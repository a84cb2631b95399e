"""A msgpack-RPC server (https://github.com/msgpack-rpc/msgpack-rpc/blob/master/spec.md) as rpclib has it, with what
CARLA puts on top: a call's first argument says whether an answer is waited for, and an answer whether it is an error.
"""

import asyncio
import logging
from collections.abc import Awaitable, Callable
from typing import Any

import msgpack

log = logging.getLogger("carla_double")
Handler = Callable[..., Awaitable[Any]]
_REQUEST, _RESPONSE = 0, 1
_CHUNK = 65_536


class Refusal(Exception):
    """The simulator's own error; the client raises it as a RuntimeError with this message."""


class Nothing:
    """What a call answers that has no value."""


class Bare:
    """A value that is answered as it is, without saying whether it is an error."""

    def __init__(self, value: Any) -> None:
        self.value = value


class RpcServer:
    """`handlers`: by the name of the call; each takes the arguments after the first. `calls` keeps what was asked."""

    def __init__(self, handlers: dict[str, Handler]) -> None:
        self._handlers = handlers
        self._connections: set[asyncio.StreamWriter] = set()
        self.calls: list[str] = []

    async def serve(self, host: str, port: int) -> asyncio.Server:
        return await asyncio.start_server(self._connection, host, port)

    def drop(self) -> None:
        """Closes all connections."""
        for writer in list(self._connections):
            writer.transport.abort()

    async def _connection(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._connections.add(writer)
        unpacker = msgpack.Unpacker(raw=False)
        try:
            while chunk := await reader.read(_CHUNK):
                unpacker.feed(chunk)
                for kind, number, name, (metadata, *arguments) in unpacker:
                    assert kind == _REQUEST
                    answer = await self._answered(number, name, arguments)
                    if not metadata[0]:
                        writer.write(answer)
                        await writer.drain()
        except ConnectionError:
            pass
        finally:
            self._connections.discard(writer)
            writer.close()

    async def _answered(self, number: int, name: str, arguments: list[Any]) -> bytes:
        self.calls.append(name)
        handler = self._handlers.get(name)
        if handler is None:
            return _packed(number, f"there is no function {name!r}", None)
        try:
            value = await handler(*arguments)
        except Refusal as error:
            return _packed(number, None, [[0, [str(error)]]])
        except Exception as error:  # a mistake of the double's, or a call that it does not understand
            log.exception("%s failed", name)
            return _packed(number, f"{name} failed: {error!r}", None)
        if isinstance(value, Nothing):
            return _packed(number, None, [[False]])
        return _packed(number, None, value.value if isinstance(value, Bare) else [[1, value]])


def _packed(number: int, error: str | None, result: Any) -> bytes:
    packed = msgpack.packb([_RESPONSE, number, error, result])
    assert isinstance(packed, bytes)
    return packed
