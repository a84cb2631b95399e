"""A chat's events on their way through, as the events of a message.

message_start
content_block_start, content_block_delta ..., content_block_stop      a text or a tool's call after another
message_delta (why it stopped, what it cost), message_stop
"""

from typing import Any

from jiter import from_json
from pydantic_core import to_json

from services.vlm_gateway.anthropic.answer import message, stop_reason, usage_of
from services.vlm_gateway.upstream.events import EventSplitter
from services.vlm_gateway.upstream.replies import Spent

_DONE = b"[DONE]"


def written(kind: str, **fields: object) -> bytes:
    """An event with its name."""
    return b"event: %s\ndata: %s\n\n" % (kind.encode(), to_json({"type": kind, **fields}))


class MessageStream:
    """`piece` for each piece of the chat's stream, `end` once it has ended well."""

    def __init__(self, model: str) -> None:
        self._model = model
        self._splitter = EventSplitter()
        self._begun = False
        self._index = -1
        self._open = ""  # the kind of the block that is open, with its call's number
        self._finish_reason: str | None = None
        self._refused = False
        self._called = False

    def piece(self, piece: bytes) -> bytes:
        """What of the message is known by it; may be empty."""
        return b"".join(self._read(event) for event in self._splitter.feed(piece))

    def end(self, used: Spent) -> bytes:
        """What is left to be told."""
        rest = b"".join(self._read(event) for event in self._splitter.last())
        reason = stop_reason(self._finish_reason, refused=self._refused)
        reason = "tool_use" if reason == "end_turn" and self._called else reason
        told = {"stop_reason": reason, "stop_sequence": None}
        ending = written("message_delta", delta=told, usage=usage_of(used)) + written("message_stop")
        return rest + self._close() + ending

    def _read(self, event: bytes) -> bytes:
        data = b"".join(line[5:].strip() for line in event.splitlines() if line.startswith(b"data:"))
        if not data or data == _DONE:
            return b""
        said = from_json(data)
        begun = b""
        if not self._begun:
            self._begun = True
            start = message(str(said.get("id") or ""), self._model, [], Spent())
            begun = written("message_start", message=start)
        choices = said.get("choices") or []
        return begun + (self._choice(choices[0]) if choices else b"")

    def _choice(self, choice: dict[str, Any]) -> bytes:
        delta = choice.get("delta") or {}
        self._finish_reason = choice.get("finish_reason") or self._finish_reason
        self._refused = self._refused or bool(delta.get("refusal"))
        events = b""
        if words := delta.get("content") or delta.get("refusal"):
            events += self._switch("text", {"type": "text", "text": ""})
            events += self._delta({"type": "text_delta", "text": words})
        for call in delta.get("tool_calls") or []:
            events += self._call(call)
        return events

    def _call(self, call: dict[str, Any]) -> bytes:
        """A tool's call, or more of its arguments: it begins where it is named."""
        self._called = True
        function = call.get("function") or {}
        kind = f"call {call.get('index', 0)}"
        block: dict[str, Any] = {"type": "tool_use", "id": call.get("id"), "name": function.get("name"), "input": {}}
        events = self._switch(kind, block)
        if arguments := function.get("arguments"):
            events += self._delta({"type": "input_json_delta", "partial_json": arguments})
        return events

    def _switch(self, kind: str, block: dict[str, Any]) -> bytes:
        if kind == self._open:
            return b""
        closed = self._close()
        self._open = kind
        self._index += 1
        return closed + written("content_block_start", index=self._index, content_block=block)

    def _delta(self, delta: dict[str, Any]) -> bytes:
        return written("content_block_delta", index=self._index, delta=delta)

    def _close(self) -> bytes:
        if not self._open:
            return b""
        self._open = ""
        return written("content_block_stop", index=self._index)
