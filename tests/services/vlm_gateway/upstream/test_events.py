"""Events of chats: cut anywhere, ended in any way, of any size, in every form in which servers tell of errors."""

import json
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.vlm_gateway.upstream.events import MAX_EVENT_BYTES, ChatReader, EventSplitter, EventTooLarge
from services.vlm_gateway.upstream.replies import Spent


def chunk(delta: dict[str, Any] | None = None, finish_reason: str | None = None, **more: Any) -> dict[str, Any]:
    choice = {"index": 0, "delta": delta or {}, "finish_reason": finish_reason}
    return {"object": "chat.completion.chunk", "choices": [choice], **more}


def event(body: object, end: str = "\n") -> bytes:
    return f"data: {json.dumps(body, ensure_ascii=False)}{end}{end}".encode()


def read(*events: bytes, without_usage: bool = False) -> tuple[ChatReader, list[bytes]]:
    reader = ChatReader()
    return reader, [reader.read(one, without_usage=without_usage)[1] for one in events]


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.text(alphabet="aé漢\u2028 {}:\"'", max_size=8), min_size=1, max_size=5),
    st.sampled_from(["\n", "\r\n", "\r"]),
    st.data(),
)
def test_events_are_whole_wherever_the_network_cuts_them_and_whatever_ends_their_lines(
    words: list[str], end: str, data: st.DataObject
) -> None:
    events = [event(chunk({"content": word}), end) for word in words] + [f": ping{end}{end}".encode()]
    raw = b"".join(events)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(raw)), max_size=12)))
    splitter, found = EventSplitter(), list[bytes]()
    for start, stop in zip([0, *cuts], [*cuts, len(raw)], strict=True):
        found += splitter.feed(raw[start:stop])
    assert b"".join([*found, *splitter.last()]) == raw
    reader, _ = read(*found)
    assert reader.content_events == sum(1 for word in words if word)


def test_an_event_of_megabytes_is_one_event_and_one_without_an_end_is_refused() -> None:
    large = event(chunk({"tool_calls": [{"function": {"arguments": "x" * 3_000_000}}]}))
    splitter, found = EventSplitter(), list[bytes]()
    for at in range(0, len(large), 65_536):
        found += splitter.feed(large[at : at + 65_536])
    assert found == [large]
    splitter.feed(b"x" * MAX_EVENT_BYTES)
    with pytest.raises(EventTooLarge):
        splitter.feed(b"x")


ERRORS = [
    ("an error object", event({"error": {"message": "no", "code": 502}})),
    ("an error text", event({"error": "no"})),
    ("an object of kind error", event({"object": "error", "message": "no", "code": 400})),
    ("a type of error", event({"type": "error", "message": "no"})),
    ("an error in the choice", event({"choices": [{"delta": {}, "error": {"message": "no"}}]})),
    ("an error event", b"event: error\ndata: " + json.dumps({"message": "no"}).encode() + b"\n\n"),
    ("an error event in words", b"event: error\r\ndata: no\r\n\r\n"),
    ("an error line", b'error: {"message": "no"}\n\n'),
    ("a detail", event({"detail": "no"})),
    ("a code and a message", event({"code": "Throttling", "message": "no"})),
]


@pytest.mark.parametrize("raw", [e[1] for e in ERRORS], ids=[e[0] for e in ERRORS])
def test_an_error_is_known_in_every_form_in_which_servers_send_it(raw: bytes) -> None:
    reader = ChatReader()
    assert reader.read(raw, without_usage=True)[0] == "error"
    assert reader.error
    assert not reader.ended


NOTHING = [
    ("a comment", b": OPENROUTER PROCESSING\n\n"),
    ("a heartbeat", b"event: ping\ndata: {}\n\n"),
    ("a role", event(chunk({"role": "assistant", "content": ""}))),
    ("a role and nulls", event(chunk({"role": "assistant", "content": None, "refusal": None, "tool_calls": []}))),
    ("no choices", event({"choices": [], "prompt_filter_results": []})),
    ("empty lines", b"\n\n"),
    ("no JSON", b"data: hello\n\n"),
]


@pytest.mark.parametrize("raw", [n[1] for n in NOTHING], ids=[n[0] for n in NOTHING])
def test_what_holds_nothing_for_the_caller_is_no_content(raw: bytes) -> None:
    assert ChatReader().read(raw, without_usage=False) == ("nothing", raw)


CONTENT = [
    {"content": "x"},
    {"content": [{"type": "text", "text": "x"}]},
    {"tool_calls": [{"index": 0, "function": {"arguments": "{"}}]},
    {"function_call": {"name": "f"}},
    {"reasoning_content": "hm"},
    {"reasoning": "hm"},
    {"refusal": "I won't"},
]


@pytest.mark.parametrize("delta", CONTENT, ids=[next(iter(delta)) for delta in CONTENT])
def test_words_calls_and_reasoning_are_content(delta: dict[str, Any]) -> None:
    assert ChatReader().read(event(chunk(delta)), without_usage=False)[0] == "content"


OUTCOMES = [
    ("words", [{"content": "x"}], "stop", False, "answered"),
    ("a tool call", [{"tool_calls": [{"index": 0}]}], "tool_calls", False, "answered"),
    ("no words", [], "stop", False, "empty"),
    ("blank words", [{"content": "  \n"}], "stop", False, "empty"),
    ("reasoning alone", [{"reasoning": "hm"}], "stop", False, "empty"),
    ("a refusal", [{"refusal": "no"}], "stop", False, "refused"),
    ("a filter", [{"content": "x"}], "content_filter", False, "refused"),
    ("cut by the server's limit", [{"content": "x"}], "length", False, "truncated"),
    ("cut by the caller's limit", [{"content": "x"}], "length", True, "answered"),
    ("no reason at all", [{"content": "x"}], None, False, "unfinished"),
    ("a reason nobody knows", [{"content": "x"}], "error", False, "unfinished"),
]


@pytest.mark.parametrize(
    ("deltas", "reason", "asked", "outcome"), [o[1:] for o in OUTCOMES], ids=[o[0] for o in OUTCOMES]
)
def test_only_what_ended_as_an_answer_does_is_answered(
    deltas: list[dict[str, Any]], reason: str | None, asked: bool, outcome: str
) -> None:
    reader, _ = read(
        *(event(chunk(delta)) for delta in deltas), event(chunk(finish_reason=reason)), b"data: [DONE]\n\n"
    )
    assert reader.ended
    assert reader.outcome(asked) == outcome


def test_usage_is_found_in_any_event_and_the_last_count_counts() -> None:
    usage = {"prompt_tokens": 7, "completion_tokens": 1}
    reader, _ = read(
        event(chunk({"content": "x"}, usage=usage)),
        event(chunk({"content": "y"}, usage=None)),
        event({"choices": [{"delta": {}, "finish_reason": "stop", "usage": {**usage, "completion_tokens": 2}}]}),
    )
    assert reader.usage == Spent(7, 2)


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_what_the_caller_did_not_ask_for_is_taken_out_and_nothing_else(end: str) -> None:
    usage = {"prompt_tokens": 7, "completion_tokens": 1, "details": {"usage": 3}}
    events = [
        event(chunk({"content": 'say "usage": null'}), end),
        event(chunk({"content": "x"}, usage=None), end),
        event(chunk({"content": "z"}, "stop", usage=usage), end),
        event({"choices": [], "usage": usage}, end),
        f"data: [DONE]{end}{end}".encode(),
    ]
    reader, passed_on = read(*events, without_usage=True)
    assert reader.usage == Spent(7, 1)
    assert passed_on[0] == events[0]
    assert passed_on[1] == event(chunk({"content": "x"}), end)
    assert json.loads(passed_on[2].removeprefix(b"data: ")) == chunk({"content": "z"}, "stop")
    assert passed_on[3:] == [b"", events[4]]
    assert read(*events)[1] == events


def test_tokens_are_estimated_by_events_and_by_their_length_where_events_are_long() -> None:
    short, _ = read(*(event(chunk({"content": "w"})) for _ in range(40)))
    long, _ = read(event(chunk({"content": "word " * 200})))
    assert short.completion_tokens == 40
    assert 150 <= long.completion_tokens <= 300
