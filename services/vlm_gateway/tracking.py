"""Which request it is: an id in the answer, the log, the model server's log and the traces; and the traces themselves.

A caller's own `x-request-id` is kept where it is fit for a header and a log line. Spans follow OpenTelemetry's
semantic conventions for generative AI: one of kind SERVER for a chat, one of kind CLIENT for every call to a model.
They are sent where OTEL_EXPORTER_OTLP_ENDPOINT says, with the extra `otel`; without it a caller's `traceparent` is
carried on as it is.
"""

import contextvars
import random
import re
from typing import Any, Protocol

from starlette.types import Message, Send

from services.vlm_gateway.upstream.replies import Spent

_FIT = re.compile(rb"[A-Za-z0-9._:/+=@-]{1,128}")

request_id: contextvars.ContextVar[bytes] = contextvars.ContextVar("request_id", default=b"")
"""Of the request that is being served."""


def request_id_of(said: bytes | None) -> bytes:
    """The caller's id, or one of ours."""
    if said is not None and _FIT.fullmatch(said):
        return said
    return b"%032x" % random.getrandbits(128)


def identified(send: Send, request_id: bytes) -> Send:
    """`send` with the request's id in the answer's headers."""

    async def sent(message: Message) -> None:
        if message["type"] == "http.response.start":
            message = {**message, "headers": [*message.get("headers", ()), (b"x-request-id", request_id)]}
        await send(message)

    return sent


class Span(Protocol):
    """`traceparent` is what is to be sent on with a call made in it; None where nothing is traced."""

    @property
    def traceparent(self) -> bytes | None: ...
    def end(self, **facts: Any) -> None: ...


class Tracer(Protocol):
    """Begins spans; `parent` is a traceparent. `close` sends what is left, and may take a while."""

    def request(self, parent: bytes | None, request_id: bytes) -> Span:
        """A chat of a caller."""
        ...

    def model_call(self, parent: bytes | None, provider: str, model: str, alias: str) -> Span:
        """One call to a model."""
        ...

    def close(self) -> None: ...


class _NoSpan:
    traceparent = None

    def end(self, **facts: Any) -> None:
        return


class NoTracer:
    """Traces nothing."""

    def request(self, parent: bytes | None, request_id: bytes) -> Span:
        return NO_SPAN

    def model_call(self, parent: bytes | None, provider: str, model: str, alias: str) -> Span:
        return NO_SPAN

    def close(self) -> None:
        return


NO_SPAN = _NoSpan()
NO_TRACER = NoTracer()


def call_facts(used: Spent | None, error: str) -> dict[str, Any]:
    """What a model call's span tells at its end."""
    facts: dict[str, Any] = {"error.type": error} if error else {}
    if used is not None:
        facts |= {"gen_ai.usage.input_tokens": used.prompt, "gen_ai.usage.output_tokens": used.completion}
    return facts
