"""One attempt at one of a model's servers."""

import time
from collections.abc import Awaitable, Callable, Sequence
from typing import NamedTuple, TypeVar

from services.vlm_gateway.errors import ModelOverloaded, ModelTimeout, ModelUnreachable
from services.vlm_gateway.upstream.endpoint import Endpoint
from services.vlm_gateway.upstream.health import Call
from services.vlm_gateway.upstream.http_reply import Buffer
from services.vlm_gateway.upstream.stream import ChatStream

T = TypeVar("T")


class Request(NamedTuple):
    """What is to be asked, of whichever server: `route` under its address, or from its root."""

    route: str
    body: Sequence[Buffer]
    trace: bytes | None
    at_root: bool = False


class Attempt(NamedTuple):
    """`call` is to be told what became of it; `deadline` is of the event loop's clock."""

    wanted: Request
    endpoint: Endpoint
    call: Call
    deadline: float

    def request(self) -> list[Buffer]:
        """As it goes to this server."""
        route, body, trace, at_root = self.wanted
        return self.endpoint.request(route, body, trace, at_root=at_root)

    async def made(self, once: "Callable[[Attempt], Awaitable[T]]") -> T:
        """`once`, counted and timed at its server; a stream counts until it is closed."""
        endpoint, began = self.endpoint, time.monotonic()
        endpoint.begin()
        kept = False
        try:
            result = await once(self)
            endpoint.answered(time.monotonic() - began)
            if isinstance(result, ChatStream):
                kept = True
                result.on_close(endpoint.end)
            return result
        except ModelOverloaded as error:
            endpoint.failed(float(error.details.get("retry_after_s", 0.0)))
            raise
        except (ModelUnreachable, ModelTimeout):
            endpoint.failed()
            raise
        finally:
            if not kept:
                endpoint.end()
                self.call.close()
