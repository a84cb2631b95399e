"""What a model server sent, read: a completion, or the typed error it stands for. Nothing here touches the network.

Servers differ most where things go wrong. What is read as an error: a status over 399; `{"error": ...}` inside a 200,
as an object (OpenAI, OpenRouter, llama.cpp) or a bare string (LM Studio, Ollama); `{"object": "error"}` (vLLM until
2025); an error inside a choice (OpenRouter, where the model failed half way); `{"detail": ...}` (servers on FastAPI).
"""

import email.utils
import json
import re
import time
from collections.abc import Mapping
from typing import Any, Literal, NamedTuple

from pydantic_core import from_json

from service_kit.errors import ServiceError
from services.vlm_gateway.errors import ModelOverloaded, ModelRejected, ModelTimeout, ModelUnreachable

Api = Literal["openai", "ollama"]

_LOADING = {503: re.compile(r"\b(?:loading|starting|warming)\b", re.IGNORECASE)}
_LOADING[500] = re.compile(r"\bloading (?:the )?model\b", re.IGNORECASE)
_DECLINED = re.compile(
    r"content[_ ]?(?:filter|policy)|data_?inspection|moderation|flagged|safety (?:system|settings|filter)",
    re.IGNORECASE,
)
_STRUCTURE = re.compile(
    r"response_format|json_schema|json_object|structured_output|structured output|guided_|grammar|invalid format|"
    r"\bschema\b|no endpoints found that (?:can handle|support)",
    re.IGNORECASE,
)
_TRACE = re.compile(r"\s*(?:File \"|Traceback \().*", re.DOTALL)  # some servers tell where on their disk it went wrong
_WAYS = {
    401: "check its api_key",
    402: "its account has no credit",
    403: "check its api_key",
    404: "check its base_url and model name",
    413: "send smaller pictures: lower its max_pixels",
}


class Spent(NamedTuple):
    """How many tokens a server says that an answer took; 0 where it says nothing."""

    prompt: int = 0
    completion: int = 0


class Said(NamedTuple):
    """`message` is the first choice's message, if there is one, in OpenAI's words."""

    message: dict[str, Any] | None
    finish_reason: str | None
    tokens: Spent


class ReplyReader:
    """For the model `alias`, whose key `secret` must not appear in any message."""

    def __init__(self, alias: str, secret: str | None) -> None:
        self._alias = alias
        self._secret = secret

    def said(self, api: Api, body: bytes, headers: Mapping[str, str]) -> Said:
        """What a 200 holds. Raises ModelUnreachable where it is no chat completion, or the error it really is."""
        try:
            reply = from_json(body, allow_inf_nan=False)
        except ValueError:
            kind = headers.get("Content-Type", "no content type").split(";")[0][:60]
            raise self.unreachable(f"the reply is no JSON ({kind}, {len(body)} bytes)", "not_json") from None
        if not isinstance(reply, dict):
            raise self.unreachable("the reply is no JSON object", "not_json")
        if (error := _error_inside(reply)) is not None:
            raise self.refusal(_status_inside(error), body, headers)
        said = _ollama(reply) if api == "ollama" else _openai(reply)
        if said is None:
            raise self.unreachable("the reply is no chat completion", "no_completion")
        return said

    def refusal(self, status: int, body: bytes, headers: Mapping[str, str]) -> ServiceError:
        """The typed error of an error reply. `details.reason` tells apart what the gateway acts on: `loading` is
        waited for, `declined` is the model's refusal, `structure` is asked again in words only."""
        details: dict[str, Any] = {"model": self._alias, "upstream_status": status}
        said, kind = self._words(body)
        if said:
            details["upstream_message"] = said
        if status in (408, 504):
            message = f"the server of model {self._alias!r} says it took too long ({status})"
            return ModelTimeout(message, details=details)
        loading = status in _LOADING and bool(_LOADING[status].search(said))
        if status in (429, 503, 529) or loading:
            wait_s = retry_after_s(headers.get("Retry-After"))
            if wait_s is not None:
                details["retry_after_s"] = round(wait_s, 3)
            if loading:
                details["reason"] = "loading"
            state = "still loading" if loading else "overloaded"
            message = f"the server of model {self._alias!r} is {state} ({status})"
            return ModelOverloaded(message, retry_after_s=wait_s or 1.0, details=details)
        if status == 500 and "validation error" in said and _STRUCTURE.search(said):
            status = 501  # llama-cpp-python's way to say that it does not know a field's value
        if 400 <= status < 500 or status == 501:
            if _DECLINED.search(kind) or (status in (400, 403) and _DECLINED.search(said)):
                details["reason"] = "declined"
            elif status in (400, 404, 422, 501) and _STRUCTURE.search(said):
                details["reason"] = "structure"
            way = _WAYS.get(status, "see upstream_message")
            message = f"the server of model {self._alias!r} refuses the request ({status}); {way}"
            return ModelRejected(message, details=details)
        details["reason"] = "status"
        return ModelUnreachable(f"the server of model {self._alias!r} answers with {status}", details=details)

    def unreachable(self, what: str, reason: str) -> ModelUnreachable:
        message = f"model {self._alias!r} can't be reached: {what}"
        return ModelUnreachable(message, details={"model": self._alias, "reason": reason})

    def _words(self, body: bytes) -> tuple[str, str]:
        """The server's own words, short and never with our key in them, and what it calls the error."""
        try:
            reply = json.loads(body)
        except (ValueError, RecursionError):
            return "", ""  # HTML pages of proxies tell nobody anything
        if not isinstance(reply, dict):
            return "", ""
        error = _error_inside(reply)
        error = reply if error is None else error
        text: object = error
        kind = ""
        if isinstance(error, dict):
            text = error.get("message") or error.get("detail")
            kind = f"{error.get('type')} {error.get('code')}"
        if isinstance(text, list):  # FastAPI's list of problems
            text = "; ".join(str(one.get("msg")) for one in text if isinstance(one, dict))
        said = _TRACE.sub("", text)[:500] if isinstance(text, str) else ""
        return (said.replace(self._secret, "***") if self._secret else said), kind


def tokens_of(usage: object) -> Spent:
    """The counts in OpenAI's `usage`; 0 where there are none."""
    counts = usage if isinstance(usage, dict) else {}
    return _tokens(counts.get("prompt_tokens"), counts.get("completion_tokens"))


def retry_after_s(value: str | None) -> float | None:
    """Seconds from a Retry-After header, which holds seconds or a date; None where it holds neither."""
    if not value:
        return None
    try:
        return max(0.0, min(float(value), 86_400.0)) if value.strip()[:1].isdigit() else _until(value)
    except ValueError:
        return _until(value)


def _until(value: str) -> float | None:
    try:
        return max(0.0, email.utils.parsedate_to_datetime(value).timestamp() - time.time())
    except (ValueError, TypeError, OverflowError):
        return None


def _openai(reply: dict[str, Any]) -> Said | None:
    choices = reply.get("choices")
    if not isinstance(choices, list):
        return None
    first = choices[0] if choices and isinstance(choices[0], dict) else {}
    return Said(_message(first.get("message")), _text(first.get("finish_reason")), tokens_of(reply.get("usage")))


def _ollama(reply: dict[str, Any]) -> Said | None:
    """Ollama's native reply: `message` with `thinking`, `done_reason`, and its own names for the tokens."""
    if "message" not in reply or reply.get("done") is False:
        return None
    message = _message(reply["message"])
    if message is not None and message.get("thinking"):
        message = {**message, "reasoning": message["thinking"]}
    tokens = _tokens(reply.get("prompt_eval_count"), reply.get("eval_count"))
    return Said(message, _text(reply.get("done_reason")), tokens)


def _message(value: object) -> dict[str, Any] | None:
    return value if isinstance(value, dict) else None


def _text(value: object) -> str | None:
    return value if isinstance(value, str) else None


def _tokens(*counts: object) -> Spent:
    prompt, completion = (n if isinstance(n, int) and not isinstance(n, bool) and n >= 0 else 0 for n in counts)
    return Spent(prompt, completion)


def _error_inside(reply: dict[str, Any]) -> object:
    """The error that a reply holds, or None."""
    if reply.get("error"):
        return reply["error"]
    if reply.get("object") == "error":
        return reply
    choices = reply.get("choices")
    if isinstance(choices, list):
        first = choices[0] if choices and isinstance(choices[0], dict) else {}
        return first.get("error") or None
    if isinstance(reply.get("code"), (str, int)) and isinstance(reply.get("message"), str):
        return reply  # DashScope's own form, with neither choices nor `error`
    return None


def _status_inside(error: object) -> int:
    """The status that an error inside a 200 stands for."""
    if isinstance(error, dict):
        for name in ("code", "status", "status_code"):
            value = error.get(name)
            if isinstance(value, int) and 400 <= value <= 599:
                return value
            if isinstance(value, str) and value.isdigit() and 400 <= int(value) <= 599:
                return int(value)
        words = f"{error.get('type')} {error.get('code')}".lower()
        if "rate" in words or "overload" in words or "unavailable" in words or "throttl" in words:
            return 503
        if "invalid" in words or "auth" in words or _DECLINED.search(words):
            return 400
    return 500
