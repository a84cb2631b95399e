"""A chat's answer, whole, as a message; and an error as Anthropic's clients read it."""

from collections.abc import Mapping
from typing import Any, Literal

from contracts.base import Wire
from service_kit.errors import ServiceError
from services.vlm_gateway.upstream.replies import Spent, tokens_of
from services.vlm_gateway.upstream.server_json import parsed

_STOPPED = {
    "stop": "end_turn",
    "length": "max_tokens",
    "tool_calls": "tool_use",
    "function_call": "tool_use",
    "content_filter": "refusal",
}
_ERRORS = {
    400: "invalid_request_error",
    401: "authentication_error",
    402: "billing_error",
    403: "permission_error",
    404: "not_found_error",
    413: "request_too_large",
    422: "invalid_request_error",
    429: "rate_limit_error",
    503: "overloaded_error",
    504: "timeout_error",
    529: "overloaded_error",
}


class ErrorFacts(Wire):
    """What went wrong: `type` is Anthropic's word for it, `code` this gateway's."""

    type: str
    message: str
    code: str
    details: dict[str, Any]


class MessagesError(Wire):
    """An error as Anthropic's clients read it."""

    type: Literal["error"] = "error"
    error: ErrorFacts
    request_id: str


def stop_reason(finish_reason: object, *, refused: bool = False) -> str:
    """In Anthropic's words."""
    return "refusal" if refused else _STOPPED.get(str(finish_reason), "end_turn")


def usage_of(used: Spent) -> dict[str, int]:
    return {"input_tokens": used.prompt, "output_tokens": used.completion}


def message(number: str, model: str, content: list[dict[str, Any]], used: Spent) -> dict[str, Any]:
    """A message that has not ended yet."""
    return {
        "id": f"msg_{number}",
        "type": "message",
        "role": "assistant",
        "model": model,
        "content": content,
        "stop_reason": None,
        "stop_sequence": None,
        "usage": usage_of(used),
    }


def message_of(body: bytes, model: str) -> dict[str, Any]:
    """The message that a completion's body is. The body was read before: it holds a choice."""
    completion = parsed(body)
    choice = completion["choices"][0]
    said: Mapping[str, Any] = choice["message"]
    text = text_of(said.get("content")) or text_of(said.get("refusal"))
    content: list[dict[str, Any]] = [{"type": "text", "text": text}] if text else []
    calls = calls_in(said)
    content += [_tool_use(call) for call in calls]
    made = message(str(completion.get("id") or ""), model, content, tokens_of(completion.get("usage")))
    refused = bool(said.get("refusal"))
    called = stop_reason(choice.get("finish_reason"), refused=refused)
    # some servers end a turn that calls a tool with "stop"
    made["stop_reason"] = "tool_use" if called == "end_turn" and calls else called
    return made


def text_of(content: object) -> str:
    """A message's words, which some servers send in parts."""
    if isinstance(content, list):
        texts = [part.get("text") for part in content if isinstance(part, dict)]
        return "".join(text for text in texts if isinstance(text, str))
    return content if isinstance(content, str) else ""


def calls_in(said: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """The calls of tools in a message, or in a piece of one."""
    calls = said.get("tool_calls")
    return [call for call in calls if isinstance(call, dict)] if isinstance(calls, list) else []


def function_of(call: Mapping[str, Any]) -> Mapping[str, Any]:
    function = call.get("function")
    return function if isinstance(function, dict) else {}


def _tool_use(call: Mapping[str, Any]) -> dict[str, Any]:
    function = function_of(call)
    return {"type": "tool_use", "id": call.get("id"), "name": function.get("name"), "input": _input(function)}


def _input(function: Mapping[str, Any]) -> dict[str, Any]:
    """A tool's arguments; what is no JSON object is told as it came."""
    said = function.get("arguments") or "{}"
    if not isinstance(said, str):  # some servers send the object itself
        return said if isinstance(said, dict) else {"arguments": said}
    try:
        found = parsed(said.encode())
    except ValueError:
        found = None
    return found if isinstance(found, dict) else {"arguments": said}


def status_of(error: ServiceError) -> int:
    """The status under which Anthropic's clients expect such an error."""
    return 400 if error.status == 422 else error.status


def error_of(error: ServiceError, request_id: str) -> MessagesError:
    kind = _ERRORS.get(error.status, "api_error" if error.status >= 500 else "invalid_request_error")
    facts = ErrorFacts(type=kind, message=error.message, code=error.code, details=error.details)
    return MessagesError(error=facts, request_id=request_id)
