"""A chat's events on their way through: held back until there is something in them for the caller, then as they come.

Until an event with words, a tool call or reasoning has come, the stream may still turn out to be an error, and another
model may be asked: comments, heartbeats and events that only name a role commit nobody. From then on it is passed on
event by event, as the server wrote them.
"""

from collections.abc import Callable, Mapping

from service_kit.running_loop import running_loop
from services.vlm_gateway.errors import ModelError, ModelTimeout, ModelUnreachable
from services.vlm_gateway.upstream import health
from services.vlm_gateway.upstream.events import MAX_EVENT_BYTES, ChatReader, EventSplitter, EventTooLarge
from services.vlm_gateway.upstream.http_reply import BrokenReply, Stream
from services.vlm_gateway.upstream.replies import ReplyReader, said_in

LINGER_S = 1.0
"""How long the connection may stay open after [DONE]; what else comes by then is passed on."""


_STREAM_TYPES = frozenset({b"text/event-stream", b"text/plain", b"application/octet-stream", b""})


def may_be_stream(headers: Mapping[bytes, bytes]) -> bool:
    """Whether a reply is to be read as one: many servers do not name the type, or write it their own way."""
    return headers.get(b"content-type", b"").partition(b";")[0].strip().lower() in _STREAM_TYPES


def late(alias: str, limit_s: float) -> ModelTimeout:
    """The model's own deadline passed."""
    return ModelTimeout(
        f"model {alias!r} gave no answer within {limit_s:g} s", details={"model": alias, "timeout_s": limit_s}
    )


class ChatStream:
    """`begin` once, then `piece` until it is empty; `close` in any case. `said` is what has come so far."""

    def __init__(
        self,
        stream: Stream,
        replies: ReplyReader,
        call: health.Call,
        *,
        alias: str,
        timeout_s: float,
        without_usage: bool,
        said: ChatReader,
    ) -> None:
        self.said = said
        self._stream = stream
        self._replies = replies
        self._call = call
        self._alias = alias
        self._timeout_s = timeout_s
        self._without_usage = without_usage
        self._splitter = EventSplitter()
        self._ready: list[bytes] = []
        self._held_bytes = 0
        self._over = False
        self._failure: ModelError | None = None
        self._due = 0.0
        self._has_data = False
        self._releases: list[Callable[[], None]] = []

    async def begin(self, deadline: float) -> None:
        """Until the first event with content, or the end of an answer without any. Raises ModelError: what the stream
        really is."""
        self._due = deadline
        while not self.said.content_events and not self._over and self._failure is None:
            await self._more()
            if self._held_bytes > MAX_EVENT_BYTES and not self.said.content_events:
                self._fail(self._replies.unreachable("its stream has nothing to say", "no_content"), "request")
        if self.said.content_events:
            self._call.brought_content()
        elif self._failure is not None:
            raise self._failure

    async def piece(self) -> bytes:
        """What has come since, whole events; empty at the end. Bounded in time between two events with data, not as a
        whole: long answers are what streams are for. Raises ModelError."""
        if self._has_data:
            self._has_data = False
            self._due = running_loop().time() + self._timeout_s
        while not self._ready and not self._over and self._failure is None:
            await self._more()
        if self._ready:
            ready, self._ready = self._ready, []
            return ready[0] if len(ready) == 1 else b"".join(ready)
        if self._failure is not None:
            raise self._failure
        return b""

    def on_close(self, release: Callable[[], None]) -> None:
        """What to give back when this is closed."""
        self._releases.append(release)

    def close(self) -> None:
        """Break off what is left, or give back what is through."""
        self._stream.close()
        self._call.close()
        releases, self._releases = self._releases, []
        for release in releases:
            release()

    async def _more(self) -> None:
        """What comes next on the connection, read into `_ready`, `_over` or `_failure`."""
        deadline = self._due
        if self.said.done:
            deadline = min(deadline, running_loop().time() + LINGER_S)
        try:
            piece = await self._stream.piece(deadline)
            skimmed = self._skim(piece) if self._splitter.is_empty else 0
            if skimmed and skimmed == len(piece):
                return
            events = self._splitter.feed(piece[skimmed:]) if piece else self._splitter.last()
        except BrokenReply as broken:
            self._broke(broken)
            return
        except EventTooLarge:
            what = f"an event of its stream is over {MAX_EVENT_BYTES} bytes"
            self._fail(self._replies.unreachable(what, "too_large"), "request")
            return
        for event in events:
            if self._skim(event):
                continue
            self._take(event)
            if self._failure is not None:
                return
        if not piece:
            self._end()

    def _skim(self, piece: bytes) -> int:
        """Take what of `piece` need not be read; how many bytes that is."""
        skimmed = self.said.skim(piece)
        if skimmed.events:
            self._has_data = True
            self._ready.append(self._replies.masked(skimmed.passed_on))
        return skimmed.end

    def _take(self, event: bytes) -> None:
        kind, passed_on = self.said.read(event, without_usage=self._without_usage)
        if kind == "error":
            error = self._replies.error(self.said.error, said_in(self._stream.headers))
            self._fail(error, "request" if isinstance(error, ModelUnreachable | ModelTimeout) else None)
            return
        if kind == "content" or (b"data" in event and not event.startswith(b":")):
            self._has_data = True
        if passed_on:
            self._ready.append(self._replies.masked(passed_on))
            self._held_bytes += len(passed_on)

    def _broke(self, broken: BrokenReply) -> None:
        if self.said.done:
            self._end()
        elif broken.reason == "late":
            self._fail(late(self._alias, self._timeout_s), "request")
        else:
            self._fail(self._replies.unreachable("the stream broke off", "cut"), "request")

    def _end(self) -> None:
        if self.said.ended:
            self._over = True
            self._call.succeeded()
        else:
            self._fail(self._replies.unreachable("the stream ended before its end", "cut"), "request")

    def _fail(self, error: ModelError, fault: health.Fault | None) -> None:
        """`fault` is None where the server did well to refuse."""
        self._failure = error
        if fault is not None:
            self._call.failed(fault)
