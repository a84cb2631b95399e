"""Which chat requests are let through: known fields only, bounded, pictures inline, one answer."""

from collections.abc import Callable
from typing import Any, NamedTuple

from service_kit.errors import BadQuestion
from services.vlm_gateway.pictures import check_data_url

MAX_MESSAGES = 200
MAX_PICTURES = 16
MAX_TOKENS = 32_768

PASSED = frozenset(
    {
        "messages",
        "temperature",
        "top_p",
        "max_tokens",
        "max_completion_tokens",
        "stop",
        "seed",
        "presence_penalty",
        "frequency_penalty",
        "logit_bias",
        "logprobs",
        "top_logprobs",
        "response_format",
        "tools",
        "tool_choice",
        "parallel_tool_calls",
        "reasoning_effort",
        "stream_options",
        "verbosity",
        "top_k",
        "min_p",
        "repetition_penalty",
    }
)
DROPPED = frozenset({"user", "metadata", "store", "service_tier", "n", "prompt_cache_key", "safety_identifier"})
"""Taken, so that clients work unchanged, but not passed on: they tell the server about the caller or ask for more than
one answer."""
_KNOWN = PASSED | DROPPED | {"model", "stream"}
_ROLES = frozenset({"system", "developer", "user", "assistant", "tool"})
_MESSAGE = frozenset({"role", "content", "name", "tool_calls", "tool_call_id", "refusal", "reasoning_content"})


CutOut = Callable[[str], bytes | None]
"""The bytes of a picture that was cut out of a request before it was parsed, or None where the text is none."""


class Chat(NamedTuple):
    """`body` is what the client sent, checked. `alias` is None where the client named no model."""

    alias: str | None
    body: dict[str, Any]
    stream: bool

    @property
    def deterministic(self) -> bool:
        return self.body.get("temperature") == 0

    @property
    def limits_length(self) -> bool:
        """Whether the caller says how long an answer may be, so that one that is cut there is what was asked for."""
        return any(self.body.get(name) is not None for name in ("max_tokens", "max_completion_tokens"))

    @property
    def wants_usage(self) -> bool:
        """Whether the caller asks what a stream cost."""
        options = self.body.get("stream_options")
        return isinstance(options, dict) and options.get("include_usage") is True


def check_chat(body: object, cut_out: CutOut) -> Chat:
    """Raises BadQuestion (`invalid`, `unknown_field`, `no_urls`, `bad_image`)."""
    if not isinstance(body, dict):
        raise invalid("body", "a JSON object is wanted")
    if not _KNOWN.issuperset(body):
        unknown = sorted(str(name)[:40] for name in set(body) - _KNOWN)
        message = f"unknown field{'s' if len(unknown) > 1 else ''} {', '.join(unknown[:8])}; known are "
        raise BadQuestion(message + ", ".join(sorted(_KNOWN)), code="unknown_field")
    if body.get("n") not in (None, 1):
        raise invalid("n", "one answer a request is given; send n=1 or leave it out")
    for name in ("max_tokens", "max_completion_tokens"):
        limit = body.get(name)
        if limit is not None and (not _is_int(limit) or not 1 <= limit <= MAX_TOKENS):
            raise invalid(name, f"a whole number from 1 to {MAX_TOKENS} is wanted")
    for name, low, high in (
        ("temperature", 0, 2),
        ("top_p", 0, 1),
        ("presence_penalty", -2, 2),
        ("frequency_penalty", -2, 2),
    ):
        value = body.get(name)
        if value is not None and (
            isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high
        ):
            raise invalid(name, f"a number from {low} to {high} is wanted")
    stream = body.get("stream", False)
    if stream is not None and not isinstance(stream, bool):
        raise invalid("stream", "true or false is wanted")
    alias = body.get("model")
    if alias is not None and (not isinstance(alias, str) or not alias or len(alias) > 80):
        raise invalid("model", "the alias of a model is wanted; GET /v1/models lists them")
    _check_messages(body.get("messages"), cut_out)
    return Chat(alias, body, bool(stream))


def _check_messages(messages: object, cut_out: CutOut) -> None:
    if not isinstance(messages, list) or not 1 <= len(messages) <= MAX_MESSAGES:
        raise invalid("messages", f"a list of 1 to {MAX_MESSAGES} messages is wanted")
    pictures = 0
    for at, message in enumerate(messages):
        where = f"messages.{at}"
        if not isinstance(message, dict) or message.get("role") not in _ROLES:
            raise invalid(f"{where}.role", f"one of {', '.join(sorted(_ROLES))} is wanted")
        if unknown := sorted(str(name)[:40] for name in set(message) - _MESSAGE):
            raise BadQuestion(f"{where}: unknown field {unknown[0]}", code="unknown_field")
        content = message.get("content")
        if isinstance(content, list):
            pictures += sum(
                _check_part(part, f"{where}.content.{index}", cut_out) for index, part in enumerate(content)
            )
        elif content is not None and not isinstance(content, str):
            raise invalid(f"{where}.content", "a text or a list of parts is wanted")
    if pictures > MAX_PICTURES:
        raise invalid("messages", f"at most {MAX_PICTURES} pictures a request are taken, not {pictures}")


def _check_part(part: object, where: str, cut_out: CutOut) -> int:
    """How many pictures the part is: 0 or 1."""
    kind = part.get("type") if isinstance(part, dict) else None
    if isinstance(part, dict) and kind == "text" and isinstance(part.get("text"), str) and len(part) == 2:
        return 0
    if isinstance(part, dict) and kind == "image_url" and len(part) == 2:
        image = part.get("image_url")
        if isinstance(image, dict) and not set(image) - {"url", "detail"}:
            check_data_url(image.get("url"), where, cut_out)
            return 1
    raise invalid(where, 'a part is {"type": "text", "text": ...} or {"type": "image_url", "image_url": {"url": ...}}')


def _is_int(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def invalid(where: str, problem: str) -> BadQuestion:
    """What is wrong with the field at `where`."""
    return BadQuestion(
        f"{where}: {problem}", code="invalid", details={"problems": [{"field": where, "problem": problem}]}
    )
