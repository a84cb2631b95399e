"""What a model's server may do wrong, as data: used by the typed questions, and by the parser through the gateway.

Each fault starts a server that really does it, and says what must come of it: the contract's outcome where the model
said something, an error's code where it did not.
"""

import contextlib
import json
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

from tests.services.vlm_gateway.kit import closed_port
from tests.services.vlm_gateway.openai_mock import Behaviour, OpenAiMock, completion, cuts, hangs, says, sends, status
from tests.services.vlm_gateway.quirky import raw

PAGE = b"<!doctype html><title>Sign in</title>"
HEAD = b"HTTP/1.1 200 OK\r\ncontent-type: application/json\r\ncontent-length: 9000\r\n\r\n"


class Fault(NamedTuple):
    """`code` is None where the model said something: then `outcome` is what is made of it. `calls` is how often the
    server is asked."""

    name: str
    behaviour: Behaviour | None
    status: int
    code: str | None = None
    reason: str | None = None
    outcome: str | None = None
    calls: int = 1

    @property
    def deadline_s(self) -> float:
        """Short where it is going to pass, ample where it must not."""
        return 2.0 if self.code == "model_timeout" else 15.0


def whole(body: object) -> Behaviour:
    return sends(json.dumps(body).encode())


FAULTS = [
    Fault("upstream down", None, 503, "model_unreachable", "connect", calls=0),
    Fault("slow first byte", hangs(), 504, "model_timeout"),
    Fault("dripping", None, 504, "model_timeout", calls=0),
    Fault("garbage instead of HTTP", None, 503, "model_unreachable", "garbage", calls=0),
    Fault("closed without a word", None, 503, "model_unreachable", "no_reply", calls=0),
    Fault("garbage instead of JSON", sends(b"\x00\xff\xfe{{{"), 503, "model_unreachable", "not_json"),
    Fault("HTML in a 200", sends(PAGE, kind="text/html"), 503, "model_unreachable", "not_json"),
    Fault("HTML in a 502", sends(PAGE, kind="text/html", status=502), 503, "model_unreachable", "status", calls=2),
    Fault("truncated JSON", sends(b'{"choices": [{"message": {"con'), 503, "model_unreachable", "not_json"),
    Fault("connection cut in the reply", cuts(b'{"choices": [{'), 503, "model_unreachable", "cut"),
    Fault("error in a 200", whole({"error": {"message": "boom"}}), 503, "model_unreachable", "status"),
    Fault("no choices at all", whole({"id": "x"}), 503, "model_unreachable", "no_completion"),
    Fault("429 with a long Retry-After", status(429, retry_after="90"), 503, "model_overloaded"),
    Fault("400", status(400, message="too many pictures"), 502, "model_rejected"),
    Fault("wrong key", status(401), 502, "model_rejected", "server_key"),
    Fault("refusal in words", says("I'm sorry, but I can't help with that."), 200, outcome="refused"),
    Fault("refusal in its field", says(None, refusal="I won't look at this."), 200, outcome="refused"),
    Fault("content filter", says("", finish_reason="content_filter"), 200, outcome="refused"),
    Fault("chatter", says("What a lovely building!"), 200, outcome="unreadable", calls=2),
    Fault("empty answer", says(""), 200, outcome="unreadable", calls=2),
    Fault("only reasoning in the text", says("<think>Hm, three or four?"), 200, outcome="unreadable", calls=2),
    Fault("only reasoning in its field", says(None, reasoning_content="hm"), 200, outcome="unreadable", calls=2),
    Fault("only reasoning, as vLLM names it", says(None, reasoning="hm"), 200, outcome="unreadable", calls=2),
    Fault("cut at the length limit", says('{"fl', finish_reason="length"), 200, outcome="unreadable", calls=2),
]
EMPTY_CHOICES = whole({**completion("x"), "choices": []})


@contextmanager
def suffering(fault: Fault, mock: OpenAiMock) -> Iterator[str]:
    """The address of a server that does it."""
    with contextlib.ExitStack() as stack:
        if fault.behaviour is not None:
            mock.will(fault.behaviour)
            yield mock.url
        elif fault.name == "upstream down":
            yield f"http://127.0.0.1:{closed_port()}/v1"
        elif fault.name == "dripping":
            yield stack.enter_context(raw(HEAD, *[b" "] * 8000, pause_s=0.02)).url
        elif fault.name == "closed without a word":
            yield stack.enter_context(raw()).url
        else:
            yield stack.enter_context(raw(b"SSH-2.0-OpenSSH_9.2p1\r\n")).url
