"""OpenAI's other routes, passed through: embeddings, completions, responses, the latter two in streams too. No cache.

The alias becomes the server's name of the model, everything else goes on as it came, but for what would make the server
fetch something, keep something, or answer more than once. Keys, budgets, places, deadlines, retries, fallbacks and the
accounts are those of chats.
"""

import json
from collections.abc import Mapping
from functools import partial
from typing import Any, NamedTuple

from jiter import from_json
from pydantic_core import to_json

from service_kit.errors import BadQuestion
from services.vlm_gateway.config import ChatLimits
from services.vlm_gateway.errors import invalid
from services.vlm_gateway.hot.calls import ModelRequest, Models
from services.vlm_gateway.hot.request import MAX_ALIAS, Chat, addresses_in
from services.vlm_gateway.keys import Key
from services.vlm_gateway.upstream.accepted import Accepted
from services.vlm_gateway.upstream.forms import COMPLETIONS, EMBEDDINGS, RESPONSES, Form
from services.vlm_gateway.upstream.http_reply import Buffer
from services.vlm_gateway.usage.accounts import estimated

WANTED = {EMBEDDINGS: "input", COMPLETIONS: "prompt", RESPONSES: "input"}
LENGTHS = ("max_tokens", "max_output_tokens")


class Further(NamedTuple):
    """What is to be asked, and whether for a stream."""

    call: ModelRequest
    stream: bool


def further(form: Form, raw: bytes, models: Models, key: Key, trace: bytes | None, limits: ChatLimits) -> Further:
    """The request, checked. Raises NotFound, Forbidden or BadQuestion."""
    body = _checked(form, raw)
    _check_lengths(body, limits.tokens)
    chat = Chat(body["model"], body, bool(body.get("stream")))
    limit = next((body[name] for name in LENGTHS if body.get(name) is not None), None)
    call = ModelRequest(
        models.asked(chat, key),
        form,
        partial(_for_target, form, chat),
        estimated(len(raw), 0, 0 if form is EMBEDDINGS else limit),
        trace,
        wants_usage=chat.wants_usage,
        limits_length=limit is not None,
    )
    return Further(call, chat.stream)


def _for_target(form: Form, chat: Chat, accepts: Accepted, _: Mapping[int, str]) -> list[Buffer]:
    body = {**chat.body, "model": json.loads(accepts.model_json)}
    if chat.stream and form.counts_when_asked and accepts.counts_streams and not chat.wants_usage:
        body["stream_options"] = {**(body.get("stream_options") or {}), "include_usage": True}
    return [to_json(body)]


def _checked(form: Form, raw: bytes) -> dict[str, Any]:
    try:
        body = from_json(raw, allow_inf_nan=False, catch_duplicate_keys=True)
    except ValueError as error:
        raise invalid("body", f"not valid JSON: {str(error)[:200]}") from None
    alias = body.get("model") if isinstance(body, dict) else None
    if not isinstance(alias, str) or not 0 < len(alias) <= MAX_ALIAS:
        raise invalid("model", "the alias of a model is wanted; GET /v1/models lists them")
    if body.get(WANTED[form]) is None:
        raise invalid(WANTED[form], "it is missing")
    _check_stream(form, body)
    for name in ("n", "best_of"):
        if body.get(name) not in (None, 1):
            raise invalid(name, "one answer a request is given; send 1 or leave it out")
    for name in ("previous_response_id", "conversation", "background"):
        if body.get(name):
            raise invalid(name, "nothing is kept between requests; send all of the input")
    if any(value[:5].lower() != "data:" for value in addresses_in(body)):
        raise BadQuestion("nothing is fetched from an address; send data: URLs", code="no_urls")
    if form is RESPONSES:
        body["store"] = False
    return dict(body)


def _check_lengths(body: Mapping[str, Any], most: int) -> None:
    """What is reserved in a budget is by these."""
    for name in LENGTHS:
        value = body.get(name)
        if value is not None and (isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= most):
            raise invalid(name, f"a whole number from 0 to {most} is wanted")


def _check_stream(form: Form, body: Mapping[str, Any]) -> None:
    stream = body.get("stream")
    if stream is not None and not isinstance(stream, bool):
        raise invalid("stream", "true or false is wanted")
    if stream and form is EMBEDDINGS:
        raise invalid("stream", "embeddings come whole; leave it out")
    options = body.get("stream_options")
    if options is not None and not isinstance(options, dict):
        raise invalid("stream_options", "an object is wanted")
