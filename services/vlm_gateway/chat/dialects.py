"""A typed question in the words of its server: OpenAI's request with one of several ways to ask for a form, or
Ollama's native one."""

from collections.abc import Sequence
from typing import Any

from pydantic_core import to_json

from services.vlm_gateway.chat.grammar import gbnf
from services.vlm_gateway.chat.prompts import Message
from services.vlm_gateway.chat.schemas import Form
from services.vlm_gateway.config import ChatModel
from services.vlm_gateway.presets import Structured
from services.vlm_gateway.upstream.client import Call


def call(model: ChatModel, conversation: Sequence[Message], form: Form, structured: Structured) -> Call:
    """The question put to `model`, its answer's form asked for in the dialect `structured`."""
    if model.server.api == "ollama":
        return _ollama_call(model, conversation, form, structured)
    body: dict[str, Any] = {
        "model": model.config.model,
        "messages": conversation,
        "temperature": model.temperature,
        model.server.max_tokens_field: model.max_tokens,
    }
    if structured in ("json_schema", "format"):
        schema = {"name": form.name, "schema": form.schema, "strict": True}
        body["response_format"] = {"type": "json_schema", "json_schema": schema}
    elif structured == "json_object":
        body["response_format"] = {"type": "json_object"}
    elif structured == "json_object_schema":
        body["response_format"] = {"type": "json_object", "schema": form.schema}
    elif structured == "guided_json":
        body["guided_json"] = form.schema
    elif structured == "structured_outputs":
        body["structured_outputs"] = {"json": form.schema}
    elif structured == "grammar":
        body["grammar"] = gbnf(form.schema)
    extra = {**model.server.extra, **model.config.extra} if structured != "none" else model.config.extra
    return Call("openai", model.base_url + "/chat/completions", to_json(body | extra))


def _ollama_call(model: ChatModel, conversation: Sequence[Message], form: Form, structured: Structured) -> Call:
    options: dict[str, Any] = {"temperature": model.temperature, "num_predict": model.max_tokens}
    if model.config.context_tokens is not None:
        options["num_ctx"] = model.config.context_tokens
    extra = dict(model.config.extra)
    options.update(extra.pop("options", {}))
    body: dict[str, Any] = {
        "model": model.config.model,
        "messages": [part for message in conversation for part in _ollama_messages(message)],
        "stream": False,
        "options": options,
    }
    if structured != "none":
        body["format"] = "json" if structured == "json_object" else form.schema
    return Call("ollama", model.base_url.removesuffix("/v1") + "/api/chat", to_json(body | extra))


def _ollama_messages(message: Message) -> list[dict[str, Any]]:
    """Ollama's messages hold a text and a list of pictures, and lose which word stood beside which picture: so each
    picture gets a message of its own, with the words that lead up to it."""
    content = message["content"]
    if isinstance(content, str):
        return [{"role": message["role"], "content": content}]
    assert isinstance(content, list)
    told: list[dict[str, Any]] = []
    words: list[str] = []
    for part in content:
        if part["type"] == "text":
            words.append(part["text"])
            continue
        picture = part["image_url"]["url"].partition(",")[2]
        told.append({"role": message["role"], "content": "\n".join(words), "images": [picture]})
        words = []
    if words:
        told.append({"role": message["role"], "content": "\n".join(words)})
    return told
