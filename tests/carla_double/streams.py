"""CARLA's streams: a client sends the number of one, and is sent every message of it from then on."""

import asyncio
from collections import defaultdict

from tests.carla_double.layouts import STREAM_ID, message


class Streams:
    """The port beside that of the remote calls."""

    def __init__(self) -> None:
        self._listeners: defaultdict[int, set[asyncio.StreamWriter]] = defaultdict(set)

    async def serve(self, host: str, port: int) -> asyncio.Server:
        return await asyncio.start_server(self._subscribed, host, port)

    def heard(self, stream: int) -> bool:
        """Whether anybody listens."""
        return bool(self._listeners[stream])

    def send(self, stream: int, body: bytes) -> None:
        """To everybody who listens, at his own speed: a client may take nothing while it waits for a tick's answer."""
        packed = message(body)
        for writer in self._listeners[stream]:
            writer.write(packed)

    def drop(self) -> None:
        """Closes all connections."""
        for writers in list(self._listeners.values()):
            for writer in list(writers):
                writer.transport.abort()
            writers.clear()

    async def _subscribed(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            (stream,) = STREAM_ID.unpack(await reader.readexactly(STREAM_ID.size))
        except (asyncio.IncompleteReadError, ConnectionError):
            writer.close()
            return
        self._listeners[stream].add(writer)
        try:
            while await reader.read(64):
                pass
        except ConnectionError:
            pass
        finally:
            self._listeners[stream].discard(writer)
            writer.close()
