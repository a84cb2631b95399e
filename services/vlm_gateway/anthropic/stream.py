"""A chat's events on their way through, as the events of a message.

message_start
content_block_start, content_block_delta ..., content_block_stop      a text or a tool's call after another
message_delta (why it stopped, what it cost), message_stop
"""

from collections.abc import Mapping
from typing import Any

from pydantic_core import to_json

from services.vlm_gateway.anthropic.answer import calls_in, function_of, message, stop_reason, text_of, usage_of
from services.vlm_gateway.upstream.events import EventSplitter, data_of
from services.vlm_gateway.upstream.replies import Spent
from services.vlm_gateway.upstream.server_json import parsed

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
        data, _ = data_of(event)
        if not data or data == _DONE:
            return b""
        try:
            said = parsed(data, allow_inf_nan=True)
        except ValueError:
            return b""
        if not isinstance(said, dict):
            return b""
        begun = b""
        if not self._begun:
            self._begun = True
            start = message(str(said.get("id") or ""), self._model, [], Spent())
            begun = written("message_start", message=start)
        choices = said.get("choices")
        first = choices[0] if isinstance(choices, list) and choices else None
        return begun + (self._choice(first) if isinstance(first, dict) else b"")

    def _choice(self, choice: dict[str, Any]) -> bytes:
        self._finish_reason = choice.get("finish_reason") or self._finish_reason
        delta = choice.get("delta")
        if not isinstance(delta, dict):
            return b""
        self._refused = self._refused or bool(delta.get("refusal"))
        events = b""
        if words := text_of(delta.get("content")) or text_of(delta.get("refusal")):
            events += self._switch("text", {"type": "text", "text": ""})
            events += self._delta({"type": "text_delta", "text": words})
        for call in calls_in(delta):
            events += self._call(call)
        return events

    def _call(self, call: Mapping[str, Any]) -> bytes:
        """A tool's call, or more of its arguments: it begins where it is named. Gemini gives all calls one index."""
        self._called = True
        function, number = function_of(call), call.get("id")
        place = f"call {call.get('index', 0)} "
        goes_on = self._open.startswith(place) and (not number or self._open == f"{place}{number}")
        block: dict[str, Any] = {"type": "tool_use", "id": number, "name": function.get("name"), "input": {}}
        events = b"" if goes_on else self._switch(f"{place}{number or ''}", block)
        if arguments := function.get("arguments"):
            told = arguments if isinstance(arguments, str) else to_json(arguments).decode()
            events += self._delta({"type": "input_json_delta", "partial_json": told})
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
