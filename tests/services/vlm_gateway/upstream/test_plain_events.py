"""Events that are like one that was read need not be read; whatever else they hold, they are."""

import json
import random

import pytest

from services.vlm_gateway.upstream.events import ChatReader, EventSplitter


def event(words: str, **more: object) -> bytes:
    choice = {"index": 0, "delta": {"content": words}, "finish_reason": None}
    said = {"id": "chatcmpl-7", "object": "chat.completion.chunk", "choices": [choice], **more}
    return b"data: " + json.dumps(said, ensure_ascii=False).encode() + b"\n\n"


def facts(reader: ChatReader) -> tuple[object, ...]:
    return (reader.content_events, reader.completion_tokens, reader.has_words, reader.finish_reason, reader.usage)


def read_in_full(events: list[bytes], *, without_usage: bool = False) -> tuple[ChatReader, bytes]:
    """Every event by a reader that has learnt nothing."""
    reader, passed_on = ChatReader(), b""
    for one in events:
        reader._plain = type(reader._plain)()
        passed_on += reader.read(one, without_usage=without_usage)[1]
    return reader, passed_on


def skimmed(events: list[bytes], pieces: list[bytes], *, without_usage: bool = False) -> tuple[ChatReader, bytes, int]:
    """The first event read, the pieces skimmed as far as that goes; how many events were read."""
    reader, splitter, reads = ChatReader(), EventSplitter(), 1
    passed_on = reader.read(events[0], without_usage=without_usage)[1]
    for piece in pieces:
        found = reader.skim(piece)
        passed_on += found.passed_on
        for one in splitter.feed(piece[found.end :]):
            again = reader.skim(one)
            passed_on += again.passed_on
            if not again.events:
                reads += 1
                passed_on += reader.read(one, without_usage=without_usage)[1]
    return reader, passed_on, reads


@pytest.mark.parametrize("usage", [{}, {"usage": None}])
def test_what_is_skimmed_is_what_would_have_been_read(usage: dict[str, object]) -> None:
    rng = random.Random(5)
    words = [" floor", " grün", "窗", '"quoted"', "line\n", "  ", "\\", " third floor, left of the red awning", "a"]
    events = [event("Hello", **usage), *(event(rng.choice(words), **usage) for _ in range(300))]
    full, passed_in_full = read_in_full(events, without_usage=bool(usage))
    reader, passed_on, reads = skimmed(events, events[1:], without_usage=bool(usage))
    assert (facts(reader), passed_on) == (facts(full), passed_in_full)
    assert reads < 150
    together, passed_together, _ = skimmed(events, [b"".join(events[1:])], without_usage=bool(usage))
    assert (facts(together), passed_together) == (facts(full), passed_in_full)


@pytest.mark.parametrize(
    "other",
    [
        event("ab").replace(b'"ab"', b'"a\\u0062"'),
        event("ab").replace(b'"ab"', b'"a\nb"'),
        event("ab").replace(b'"ab"', b'""'),
        event("ab").replace(b'"ab"', b'"ab","tool_calls":[{"index":0}]'),
        event("ab").replace(b'"finish_reason": null', b'"finish_reason": "stop"'),
        event("ab", usage={"prompt_tokens": 3, "completion_tokens": 1}),
        event("ab", error={"message": "no"}),
        event("ab").replace(b"data: ", b"event: error\ndata: "),
        event("\ud800".encode("utf-8", "replace").decode()).replace(b'"?"', b'"\xff"'),
    ],
)
def test_an_event_that_says_more_is_read(other: bytes) -> None:
    reader = ChatReader()
    reader.read(event("Hello"), without_usage=False)
    assert reader.skim(event(" you")).events == 1
    assert reader.skim(other).events == 0


def test_nothing_is_learnt_from_words_that_may_stand_elsewhere() -> None:
    for words in (":", ", ", "content", "chatcmpl"):
        reader = ChatReader()
        reader.read(event(words, note=words), without_usage=False)
        assert reader.skim(event(" you", note=words)).events == 0


def test_spaces_alone_are_no_words() -> None:
    reader = ChatReader()
    reader.read(event("x"), without_usage=False)
    reader.has_words = False
    assert reader.skim(event("  ")).blank
    assert not reader.has_words
