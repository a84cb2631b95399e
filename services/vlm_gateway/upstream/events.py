"""Server-sent events of a chat, cut at their ends and read for what they say.

An event ends at an empty line, whatever the server ends its lines with (LF, CRLF or CR), wherever the network cuts it,
and however long it is. What is read of it: words, tool calls, why the answer ends, what it cost, and errors in every
form that servers send them in: `{"error": ...}`, an object of kind `error`, an event named `error`, a line `error:`.
"""

import re
from collections.abc import Iterator
from typing import Any, Literal

from pydantic_core import to_json

from services.vlm_gateway.upstream.error_forms import error_inside
from services.vlm_gateway.upstream.plain_events import PlainEvents, Skimmed
from services.vlm_gateway.upstream.replies import Spent, tokens_of
from services.vlm_gateway.upstream.server_json import parsed

MAX_EVENT_BYTES = 8 * 1024 * 1024
SMALL_BYTES = 64 * 1024
"""What is larger is not looked through again for every piece that comes."""
CHARACTERS_A_TOKEN = 4
MOST_CHARACTERS_A_TOKEN = 8
"""An event with more than this holds several tokens."""

_EMPTY_LINE = re.compile(rb"(?>\r\n|\n|\r)(?>\r\n|\n|\r)")
_AROUND = b"\r\n\xef\xbb\xbf"
_LINE_END = re.compile(rb"\r\n|\n|\r")
_NO_USAGE = re.compile(rb',\s*"usage"\s*:\s*null(?=\s*[,}])')
_WORDS = ("content", "text")
_REASONING = ("reasoning_content", "reasoning", "reasoning_details", "thinking", "images", "audio")
_CALLS = ("tool_calls", "function_call")
_ENDINGS = frozenset({"stop", "tool_calls", "function_call", "length", "eos_token", "stop_sequence"})
"""OpenAI's, and two of text-generation-inference's."""

Kind = Literal["nothing", "content", "error"]


class EventTooLarge(Exception):
    """An event is over MAX_EVENT_BYTES."""


class EventSplitter:
    """Whole events out of bytes as they come in, with their line ends as they were."""

    def __init__(self) -> None:
        self._rest = bytearray()
        self._searched = 0

    @property
    def is_empty(self) -> bool:
        """Whether what comes next begins a new event."""
        return not self._rest

    def feed(self, piece: bytes) -> list[bytes]:
        """All events that are whole now. Raises EventTooLarge."""
        if not self._rest and piece.endswith(b"\n\n") and piece.find(b"\n\n") == len(piece) - 2 and b"\r" not in piece:
            return [piece]  # one event a piece, as most servers write them
        rest = self._rest
        rest += piece
        if len(rest) <= SMALL_BYTES and b"\r" not in rest:
            *whole, after = bytes(rest).split(b"\n\n")
            self._rest, self._searched = bytearray(after), 0
            return [event + b"\n\n" for event in whole]
        events: list[bytes] = []
        at = 0
        for end in _EMPTY_LINE.finditer(rest, self._searched):
            events.append(bytes(rest[at : end.end()]))
            at = end.end()
        del rest[:at]
        self._searched = max(0, len(rest) - 3)  # an empty line may be cut by the network
        if len(rest) > MAX_EVENT_BYTES:
            raise EventTooLarge
        return events

    def last(self) -> list[bytes]:
        """What is left at the end of the stream: an event without its empty line, or none."""
        rest = bytes(self._rest)
        self._rest.clear()
        self._searched = 0
        return [rest] if rest else []


class ChatReader:
    """What a chat's events have said so far. `usage` is the server's own count, None until an event has one."""

    def __init__(self) -> None:
        self.done = False
        self.finish_reason: str | None = None
        self.has_words = False
        self.has_calls = False
        self.refused = False
        self.usage: Spent | None = None
        self.error: object = None
        self.content_events = 0
        self._characters = 0
        self._counted = 0
        self._plain = PlainEvents()

    @property
    def ended(self) -> bool:
        """Whether the server said that this is all: by [DONE], or by why it stopped (`transformers serve` sends no
        [DONE])."""
        return self.done or self.finish_reason is not None

    @property
    def completion_tokens(self) -> int:
        """An estimate, where the server does not count: one token an event, more where events are longer than tokens
        are."""
        if self._characters <= MOST_CHARACTERS_A_TOKEN * self.content_events:
            return self.content_events
        return max(self.content_events, self._characters // CHARACTERS_A_TOKEN)

    def used(self, prompt: int) -> Spent:
        """What the server counted, and an estimate of what came after that or was not counted; `prompt` is one of the
        request."""
        counted = self.usage or Spent()
        return Spent(counted.prompt or prompt, counted.completion + self.completion_tokens - self._counted)

    def outcome(self, length_asked_for: bool) -> str:
        """`answered` where it ended as an answer does, with words or a tool call in it; else what is wrong with it."""
        return outcome_of(
            self.finish_reason,
            has_content=self.has_words or self.has_calls,
            refused=self.refused,
            length_asked_for=length_asked_for,
        )

    def skim(self, piece: bytes) -> Skimmed:
        """The events at the beginning of `piece` that need not be read, as they are like one that was."""
        skimmed = self._plain.skim(piece)
        if skimmed.events:
            self.content_events += skimmed.events
            self._characters += skimmed.characters
            self.has_words = self.has_words or not skimmed.blank
        return skimmed

    def read(self, event: bytes, *, without_usage: bool) -> tuple[Kind, bytes]:
        """What one event is, and what is to be passed on of it: nothing of its `usage` where that is not wanted.

        After `error`, the error is in `error`: an object, a list or a text."""
        data, named_error = data_of(event)
        if data is None:
            return "nothing", event
        if data == b"[DONE]":
            self.done = True
            return "nothing", event
        try:
            said = parsed(data, allow_inf_nan=True)
        except ValueError:
            if named_error:
                self.error = data.decode("utf-8", "replace")
                return "error", event
            return "nothing", event
        if not isinstance(said, dict):
            self.error = said if named_error else None
            return ("error" if named_error else "nothing"), event
        error = self._error_in(said, named_error)
        if error is not None:
            self.error = error
            return "error", event
        if event.lstrip(_AROUND).startswith(b"{"):
            return "nothing", event  # an object that is no field of an event
        kind = self._chunk(said)
        passed_on = _without_usage(event, data, said) if without_usage and "usage" in said else event
        if kind == "content" and (words := self._only_words(said)):
            self._plain.learn(event, passed_on, words)
        return kind, passed_on

    def _error_in(self, said: dict[str, Any], named_error: bool) -> object:
        """The error that an event holds or is, or None."""
        error = error_inside(said)
        if error is None and (named_error or ("choices" not in said and "detail" in said)):
            return said
        return error

    def _only_words(self, said: dict[str, Any]) -> str:
        """The words of a chunk that says nothing else; empty where it does."""
        choice = said["choices"][0]
        delta = choice.get("delta") if isinstance(choice, dict) else None
        if len(said["choices"]) > 1 or not isinstance(delta, dict) or choice.get("finish_reason"):
            return ""
        telling = [name for name, value in delta.items() if value and name != "role"]
        words = delta.get("content")
        counted = said.get("usage") or choice.get("usage")
        return words if telling == ["content"] and isinstance(words, str) and not counted else ""

    def _chunk(self, said: dict[str, Any]) -> Kind:
        """A chunk of the completion."""
        usage = said.get("usage")
        kind: Kind = "nothing"
        choices = said.get("choices")
        for choice in choices if isinstance(choices, list) else ():
            if not isinstance(choice, dict):
                continue
            usage = usage or choice.get("usage")
            reason = choice.get("finish_reason")
            if isinstance(reason, str) and reason:
                self.finish_reason = reason
            delta = choice.get("delta") or choice.get("message") or choice
            if isinstance(delta, dict) and self._delta(delta):
                kind = "content"
        if kind == "content":
            self.content_events += 1
        self._count(usage)
        return kind

    def _count(self, usage: object) -> None:
        """Of a server that counts from event to event the last count holds; what is all zeros was not counted."""
        counted = tokens_of(usage)
        if counted != Spent():
            self.usage = counted
            self._counted = self.completion_tokens if counted.completion else 0

    def read_whole(self, reply: dict[str, Any]) -> None:
        """A reply that is no stream."""
        if "choices" in reply:
            self._chunk(reply)

    def _delta(self, delta: dict[str, Any]) -> bool:
        """Whether there is something in it for the caller."""
        found = False
        for name, value in delta.items():
            if not value or name == "role":
                continue
            if name in _WORDS:
                self.has_words = self.has_words or not isinstance(value, str) or not value.isspace()
            elif name in _CALLS:
                self.has_calls = True
            elif name == "refusal":
                self.refused = True
            elif name not in _REASONING:
                continue
            found = True
            self._characters += len(value) if isinstance(value, str) else len(to_json(value)) // 2
        return found


def outcome_of(finish_reason: str | None, *, has_content: bool, refused: bool, length_asked_for: bool) -> str:
    """What an answer that came without an error is: `answered`, or why it is none that is kept."""
    if refused or finish_reason == "content_filter":
        return "refused"
    if finish_reason == "length" and not length_asked_for:
        return "truncated"
    if finish_reason not in _ENDINGS:
        return "unfinished"
    return "answered" if has_content else "empty"


def data_of(event: bytes) -> tuple[bytes | None, bool]:
    """An event's data, its lines joined, and whether the event says by its name that it is an error."""
    if event.startswith(b"data:"):
        data = event[5:].strip()
        if b"\n" not in data and b"\r" not in data:
            return data, False
    stripped = event.strip(_AROUND)
    if stripped.startswith(b"{"):
        return stripped, False  # an error that was written into the stream as if it were a reply
    lines: list[bytes] = []
    named_error = False
    for name, value in _fields(stripped):
        if name == b"data":
            lines.append(value)
        elif name == b"error" and value:
            lines.append(value)
            named_error = True
        elif name == b"event" and value.strip().lower() == b"error":
            named_error = True
    return (b"\n".join(lines).strip() if lines else None), named_error


def _fields(event: bytes) -> Iterator[tuple[bytes, bytes]]:
    for line in _LINE_END.split(event):
        name, _, value = line.partition(b":")
        if name:  # a line that begins with a colon is a comment
            yield name, value.removeprefix(b" ")


def _without_usage(event: bytes, data: bytes, said: dict[str, Any]) -> bytes:
    """The event as it would be had the server not been asked what the answer costs; empty where that is all it says."""
    if said["usage"] is None and event.count(b'"usage"') == 1:
        without, times = _NO_USAGE.subn(b"", event)
        if times:
            return without
    if not said.get("choices"):
        return b""
    rest = to_json({name: value for name, value in said.items() if name != "usage"})
    other = [line for line in _LINE_END.split(event.strip(_AROUND)) if line and not line.startswith(b"data:")]
    return b"\n".join([*other, b"data: " + rest]) + b"\n\n"
