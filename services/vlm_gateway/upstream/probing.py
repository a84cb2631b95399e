"""Active health checks of the servers behind one alias: a server that is found dead gets no callers to find out."""

import asyncio
from collections.abc import Sequence

from service_kit.running_loop import running_loop
from services.vlm_gateway.upstream.endpoint import Endpoint
from services.vlm_gateway.upstream.http_reply import BrokenReply

MAX_REPLY_BYTES = 1024 * 1024
FAILURES = 2
"""So many checks in a row have to fail."""


class Prober:
    """Asks each server every `every_s` seconds; 0 asks none. `start` in a running loop, any number of times."""

    def __init__(self, endpoints: Sequence[Endpoint], every_s: float, timeout_s: float) -> None:
        self._endpoints = endpoints
        self._every_s = every_s
        self._timeout_s = timeout_s
        self._tasks: list[asyncio.Task[None]] = []

    def start(self) -> None:
        if self._endpoints and not self._tasks and self._every_s > 0.0:
            self._tasks = [asyncio.create_task(self._watch(endpoint)) for endpoint in self._endpoints]

    async def close(self) -> None:
        tasks, self._tasks = self._tasks, []
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def _watch(self, endpoint: Endpoint) -> None:
        failed = 0
        while True:
            problem = await self._problem(endpoint)
            failed = failed + 1 if problem else 0
            if not problem or failed >= FAILURES:
                endpoint.checked(problem)
            await asyncio.sleep(self._every_s)

    async def _problem(self, endpoint: Endpoint) -> str:
        """Empty where the server answers at all: whoever refuses a key is alive."""
        deadline = running_loop().time() + self._timeout_s
        try:
            reply = await endpoint.pool.whole(endpoint.get("/models"), deadline, MAX_REPLY_BYTES)
        except BrokenReply as broken:
            return broken.reason
        return f"status {reply.status}" if reply.status >= 500 else ""
