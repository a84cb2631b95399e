"""Which chat requests are let through: bounded, pictures inline, one answer. What a message carries beside its words
is for the target to take or to drop (rewriting.py)."""

from collections.abc import Iterator
from typing import Any, NamedTuple

from service_kit.errors import BadQuestion
from services.vlm_gateway.config import ChatLimits
from services.vlm_gateway.errors import invalid
from services.vlm_gateway.pictures import ChatPicture, CutOuts, inline_picture
from services.vlm_gateway.upstream.accepted import STANDARD_IMAGE, STANDARD_MESSAGE, STANDARD_PART

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
        "functions",
        "function_call",
        "reasoning_effort",
        "stream_options",
        "verbosity",
        "top_k",
        "min_p",
        "repetition_penalty",
    }
)
DROPPED = frozenset(
    {
        "user",
        "metadata",
        "store",
        "service_tier",
        "n",
        "prompt_cache_key",
        "prompt_cache_retention",
        "safety_identifier",
    }
)
"""Taken, so that clients work unchanged, but not passed on: they tell the server about the caller or ask for more than
one answer."""
_KNOWN = PASSED | DROPPED | {"model", "stream"}
_ROLES = ("user", "assistant", "system", "tool", "developer", "function")  # no set: what comes may be no text
MAX_ALIAS = 128
_RANGES = {"temperature": (0, 2), "top_p": (0, 1), "presence_penalty": (-2, 2), "frequency_penalty": (-2, 2)}
_BOUNDED = frozenset({*_RANGES, "max_tokens", "max_completion_tokens"})


class Chat(NamedTuple):
    """`body` is what the client sent, checked. `alias` is None where the client named no model. `further` are the
    fields that not every server takes. `plain`: every server takes the messages as they are."""

    alias: str | None
    body: dict[str, Any]
    stream: bool
    further: frozenset[str] = frozenset()
    pictures: tuple[ChatPicture, ...] = ()
    plain: bool = True

    @property
    def deterministic(self) -> bool:
        return self.body.get("temperature") == 0

    @property
    def max_tokens(self) -> int | None:
        """How long the caller says that an answer may be, if it does."""
        limit = self.body.get("max_completion_tokens")
        limit = self.body.get("max_tokens") if limit is None else limit
        return limit if isinstance(limit, int) else None

    @property
    def wants_usage(self) -> bool:
        """Whether the caller asks what a stream cost."""
        options = self.body.get("stream_options")
        return isinstance(options, dict) and options.get("include_usage") is True


def check_chat(body: object, cut_outs: CutOuts, limits: ChatLimits) -> Chat:
    """Raises BadQuestion (`invalid`, `no_urls`, `bad_image`)."""
    if not isinstance(body, dict):
        raise invalid("body", "a JSON object is wanted")
    further = frozenset[str]()
    if not _KNOWN.issuperset(body):
        further = frozenset(name for name, value in body.items() if name not in _KNOWN and value is not None)
    if body.get("n") not in (None, 1):
        raise invalid("n", "one answer a request is given; send n=1 or leave it out")
    _check_numbers(body, limits)
    stream = body.get("stream", False)
    if stream is not None and not isinstance(stream, bool):
        raise invalid("stream", "true or false is wanted")
    options = body.get("stream_options")
    if options is not None and not isinstance(options, dict):
        raise invalid("stream_options", "an object is wanted")
    alias = body.get("model")
    if alias is not None and (not isinstance(alias, str) or not alias or len(alias) > MAX_ALIAS):
        raise invalid("model", "the alias of a model is wanted; GET /v1/models lists them")
    pictures, plain = _check_messages(body.get("messages"), cut_outs, limits)
    return Chat(alias, body, bool(stream), further, pictures, plain)


def _check_numbers(body: dict[str, Any], limits: ChatLimits) -> None:
    for name in _BOUNDED.intersection(body):
        value = body[name]
        if value is None:
            continue
        if name not in _RANGES:
            if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= limits.tokens:
                raise invalid(name, f"a whole number from 1 to {limits.tokens} is wanted")
            continue
        low, high = _RANGES[name]
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
            raise invalid(name, f"a number from {low} to {high} is wanted")


class _Messages(NamedTuple):
    pictures: tuple[ChatPicture, ...]
    plain: bool


def _check_messages(messages: object, cut_outs: CutOuts, limits: ChatLimits) -> _Messages:
    if not isinstance(messages, list) or not 1 <= len(messages) <= limits.messages:
        raise invalid("messages", f"a list of 1 to {limits.messages} messages is wanted")
    pictures: list[ChatPicture] = []
    plain = True
    for at, message in enumerate(messages):
        if not isinstance(message, dict) or message.get("role") not in _ROLES:
            raise invalid(f"messages.{at}.role", f"one of {', '.join(sorted(_ROLES))} is wanted")
        content = message.get("content")
        if isinstance(content, list):
            for index, part in enumerate(content):
                picture = _check_part(part, (at, index), cut_outs, limits)
                if picture is not None:
                    pictures.append(picture)
                plain = plain and _is_plain(part, picture)
        elif content is not None and not isinstance(content, str):
            raise invalid(f"messages.{at}.content", "a text or a list of parts is wanted")
        plain = plain and STANDARD_MESSAGE.issuperset(message) and message["role"] != "developer"
    if len(pictures) > limits.pictures:
        raise invalid("messages", f"at most {limits.pictures} pictures a request are taken, not {len(pictures)}")
    return _Messages(tuple(pictures), plain)


def _check_part(part: object, place: tuple[int, int], cut_outs: CutOuts, limits: ChatLimits) -> ChatPicture | None:
    """The picture that the part is, if it is one."""
    where = f"messages.{place[0]}.content.{place[1]}"
    if isinstance(part, dict) and isinstance(kind := part.get("type"), str):
        if kind == "image_url":
            image = part.get("image_url")
            url = image.get("url") if isinstance(image, dict) else image
            return inline_picture(url, where, place, cut_outs, limits)
        if kind != "text":
            _check_inline(part, where)
            return None
        if isinstance(part.get("text"), str):
            return None
    raise invalid(where, 'a part is {"type": "text", "text": ...} or {"type": "image_url", "image_url": {"url": ...}}')


def _check_inline(part: dict[str, Any], where: str) -> None:
    """Raises BadQuestion (`no_urls`) where a model's server would fetch something."""
    if any(url[:5].lower() != "data:" for url in addresses_in(part)):
        raise BadQuestion(f"{where}: nothing is fetched from an address; send a data: URL", code="no_urls")


def addresses_in(value: object) -> Iterator[str]:
    """What stands, at any depth, under a name that says that it is an address; what is only cited is left out."""
    if isinstance(value, dict):
        for name, inner in value.items():
            if name in ("annotations", "metadata"):
                continue
            if isinstance(inner, str) and (name == "url" or name.endswith("_url")):
                yield inner
            else:
                yield from addresses_in(inner)
    elif isinstance(value, list):
        for inner in value:
            yield from addresses_in(inner)


def _is_plain(part: dict[str, Any], picture: ChatPicture | None) -> bool:
    if not STANDARD_PART.issuperset(part):
        return False
    if picture is None:
        return bool(part["type"] == "text")
    image = part["image_url"]
    return picture.correct and isinstance(image, dict) and STANDARD_IMAGE.issuperset(image)


def part_types(chat: Chat) -> frozenset[str]:
    """The kinds of parts in a chat that are neither texts nor pictures; what an assistant thought is not counted."""
    contents = (message.get("content") for message in chat.body["messages"] if message["role"] != "assistant")
    parts = (part for content in contents if isinstance(content, list) for part in content)
    return frozenset(part["type"] for part in parts) - {"text", "image_url"}


def unknown_fields(names: frozenset[str], alias: str) -> BadQuestion:
    """The error of fields that a model's server is not known to take."""
    shown = ", ".join(sorted(name[:40] for name in names)[:8])
    return BadQuestion(
        f"unknown field{'s' if len(names) > 1 else ''} {shown}: model {alias!r} is not known to take "
        f"{'them' if len(names) > 1 else 'it'}; the operator can let it through with pass = [...], or leave it out; "
        f"known are {', '.join(sorted(_KNOWN))}",
        code="unknown_field",
    )


def unknown_parts(kinds: frozenset[str], alias: str) -> BadQuestion:
    """The error of parts that a model's server is not known to take."""
    shown = ", ".join(sorted(kind[:40] for kind in kinds)[:8])
    return BadQuestion(
        f"model {alias!r} is not known to take parts of type {shown}, only text and image_url; the operator can let "
        "them through with part_types = [...]",
        code="unknown_part",
    )
