"""A request for a message in the words of a chat. What it asks for is checked as a chat is, once it is one."""

from collections.abc import Iterable, Mapping
from typing import Any

from jiter import from_json
from pydantic_core import to_json

from service_kit.errors import BadQuestion
from services.vlm_gateway.errors import invalid

_PASSED = ("model", "max_tokens", "temperature", "top_p", "top_k", "stream")
_DROPPED = frozenset(
    {"metadata", "service_tier", "thinking", "output_config", "inference_geo", "cache_control", "context_management"}
)
"""Taken, so that clients work unchanged: they tell the server about the caller, or ask for what a chat may not have."""
_KNOWN = _DROPPED | {*_PASSED, "messages", "system", "tools", "tool_choice", "stop_sequences"}
_CHOICES = {"auto": "auto", "any": "required", "none": "none"}
_THOUGHTS = frozenset({"thinking", "redacted_thinking"})


def chat_of(raw: bytes) -> dict[str, Any]:
    """Raises BadQuestion (`invalid`, `unknown_field`, `unknown_part`, `no_urls`)."""
    try:
        asked = from_json(raw, allow_inf_nan=False, catch_duplicate_keys=True)
    except ValueError as error:
        raise invalid("body", f"not valid JSON: {str(error)[:200]}") from None
    if not isinstance(asked, dict):
        raise invalid("body", "a JSON object is wanted")
    if unknown := sorted(name[:40] for name, value in asked.items() if name not in _KNOWN and value is not None):
        known = ", ".join(sorted(_KNOWN))
        raise BadQuestion(f"unknown fields {', '.join(unknown[:8])}; known are {known}", code="unknown_field")
    if not isinstance(asked.get("model"), str):
        raise invalid("model", "the alias of a model is wanted; GET /v1/models lists them")
    chat = {name: asked[name] for name in _PASSED if asked.get(name) is not None}
    if asked.get("stop_sequences"):
        chat["stop"] = asked["stop_sequences"]
    messages = _list(asked.get("messages"), "messages")
    chat["messages"] = [*_system(asked.get("system")), *_messages(messages)]
    if asked.get("tools"):
        chat["tools"] = [_tool(tool, at) for at, tool in enumerate(_list(asked["tools"], "tools"))]
        chat |= _tool_choice(asked.get("tool_choice"))
    return chat


def _list(value: object, where: str) -> list[Any]:
    if not isinstance(value, list) or not value:
        raise invalid(where, "a list is wanted")
    return value


def _system(system: object) -> list[dict[str, Any]]:
    if system is None or system == []:
        return []
    if isinstance(system, str):
        return [{"role": "system", "content": system}]
    return [{"role": "system", "content": _text(system, "system")}]


def _text(content: object, where: str) -> str:
    """Texts alone, one after another."""
    if isinstance(content, str):
        return content
    blocks = _list(content, where)
    if not all(isinstance(block, dict) and isinstance(block.get("text"), str) for block in blocks):
        raise invalid(where, 'a text, or a list of {"type": "text", "text": ...}, is wanted')
    return "\n\n".join(block["text"] for block in blocks)


def _messages(messages: Iterable[object]) -> Iterable[dict[str, Any]]:
    for at, message in enumerate(messages):
        where = f"messages.{at}"
        role = message.get("role") if isinstance(message, dict) else None
        if not isinstance(message, dict) or role not in ("user", "assistant", "system"):
            raise invalid(f"{where}.role", "one of user, assistant is wanted")
        content = message.get("content")
        if isinstance(content, str):
            yield {"role": role, "content": content}
        elif role == "system":
            yield {"role": role, "content": _text(content, f"{where}.content")}
        elif role == "user":
            yield from _of_user(_list(content, f"{where}.content"), f"{where}.content")
        else:
            yield _of_assistant(_list(content, f"{where}.content"), f"{where}.content")


def _of_user(blocks: list[Any], where: str) -> Iterable[dict[str, Any]]:
    """The results of tools first, each a message of its own, as chats want them; then what the user says."""
    parts: list[dict[str, Any]] = []
    for at, block in enumerate(blocks):
        place = f"{where}.{at}"
        kind = _kind(block, place)
        if kind == "tool_result":
            if not isinstance(block.get("tool_use_id"), str):
                raise invalid(f"{place}.tool_use_id", "the id of the tool_use that it is a result of is wanted")
            texts, pictures = _result(block, place)
            yield {"role": "tool", "tool_call_id": block["tool_use_id"], "content": texts}
            parts += pictures
        else:
            parts.append(_part(block, kind, place))
    if parts:
        only_words = len(parts) == 1 and parts[0]["type"] == "text"
        yield {"role": "user", "content": parts[0]["text"] if only_words else parts}


def _result(block: Mapping[str, Any], where: str) -> tuple[str, list[dict[str, Any]]]:
    """What a tool said, and the pictures that it gave, which go into the user's message."""
    content = block.get("content")
    content = [{"type": "text", "text": content}] if isinstance(content, str) else content or []
    if not isinstance(content, list):
        raise invalid(f"{where}.content", "a text or a list of blocks is wanted")
    parts = [_part(inner, _kind(inner, where), where) for inner in content]
    words = "\n".join(part["text"] for part in parts if part["type"] == "text")
    pictures = [part for part in parts if part["type"] != "text"]
    return ("error: " + words if block.get("is_error") else words), pictures


def _part(block: Mapping[str, Any], kind: str, where: str) -> dict[str, Any]:
    source = block.get("source")
    if kind == "text" and isinstance(block.get("text"), str):
        return {"type": "text", "text": block["text"]}
    if kind == "image" and isinstance(source, dict):
        if source.get("type") != "base64":
            raise BadQuestion(f"{where}: nothing is fetched from an address; send base64", code="no_urls")
        url = f"data:{source.get('media_type')};base64,{source.get('data')}"
        return {"type": "image_url", "image_url": {"url": url}}
    if kind == "document" and isinstance(source, dict) and source.get("type") == "text":
        return {"type": "text", "text": str(source.get("data"))}
    raise BadQuestion(
        f"{where}: blocks of type {kind[:40]!r} are not taken here; known are text, image, tool_use, tool_result",
        code="unknown_part",
    )


def _of_assistant(blocks: list[Any], where: str) -> dict[str, Any]:
    texts: list[str] = []
    calls: list[dict[str, Any]] = []
    for at, block in enumerate(blocks):
        kind = _kind(block, f"{where}.{at}")
        if kind == "tool_use":
            if not isinstance(block.get("id"), str) or not isinstance(block.get("name"), str):
                raise invalid(f"{where}.{at}", "a tool_use with an id and a name is wanted")
            function = {"name": block.get("name"), "arguments": to_json(block.get("input") or {}).decode()}
            calls.append({"id": block.get("id"), "type": "function", "function": function})
        elif kind not in _THOUGHTS:
            texts.append(_part(block, kind, f"{where}.{at}").get("text", ""))
    message: dict[str, Any] = {"role": "assistant", "content": "".join(texts) or None}
    return message | ({"tool_calls": calls} if calls else {})


def _kind(block: object, where: str) -> str:
    kind = block.get("type") if isinstance(block, dict) else None
    if not isinstance(kind, str):
        raise invalid(where, "a block with a type is wanted")
    return kind


def _tool(tool: object, at: int) -> dict[str, Any]:
    if not isinstance(tool, dict) or not isinstance(tool.get("name"), str):
        raise invalid(f"tools.{at}", "a tool with a name and an input_schema is wanted")
    if tool.get("type") not in (None, "custom"):
        raise invalid(f"tools.{at}.type", "tools that a server runs are not taken here, only the caller's own")
    function = {"name": tool["name"], "parameters": tool.get("input_schema") or {"type": "object", "properties": {}}}
    if tool.get("description"):
        function["description"] = tool["description"]
    return {"type": "function", "function": function}


def _tool_choice(choice: object) -> dict[str, Any]:
    if choice is None:
        return {}
    kind = choice.get("type") if isinstance(choice, dict) else None
    if not isinstance(choice, dict) or kind not in (*_CHOICES, "tool"):
        raise invalid("tool_choice", "one of auto, any, tool, none is wanted as its type")
    named = {"type": "function", "function": {"name": choice.get("name")}}
    chosen: dict[str, Any] = {"tool_choice": named if kind == "tool" else _CHOICES[str(kind)]}
    return chosen | ({"parallel_tool_calls": False} if choice.get("disable_parallel_tool_use") else {})
