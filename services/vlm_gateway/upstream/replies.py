"""What a model server sent, read: a completion, or the typed error it stands for. Nothing here touches the network.

Servers differ most where things go wrong. What is read as an error: a status over 399, also with `{"detail": ...}`
(servers on FastAPI), and what `error_forms.py` finds inside a 200.
"""

import email.utils
import json
import re
import time
from collections.abc import Mapping
from typing import Any, Literal, NamedTuple

from services.vlm_gateway.errors import (
    CONTEXT_LENGTH,
    ModelError,
    ModelMisconfigured,
    ModelNotFound,
    ModelOverloaded,
    ModelRateLimited,
    ModelRejected,
    ModelTimeout,
    ModelUnreachable,
)
from services.vlm_gateway.upstream.error_forms import CONTEXT, DECLINED, error_inside, status_inside
from services.vlm_gateway.upstream.server_json import parsed

Api = Literal["openai", "ollama", "other"]

_LOADING = {503: re.compile(r"\b(?:loading|starting|warming)\b", re.IGNORECASE)}
_LOADING[500] = re.compile(r"\bloading (?:the )?model\b", re.IGNORECASE)
_STRUCTURE = re.compile(
    r"response_format|json_schema|json_object|structured_output|structured output|guided_|grammar|invalid format|"
    r"\bschema\b|no endpoints found that (?:can handle|support)",
    re.IGNORECASE,
)
_TRACE = re.compile(r"\s*(?:File \"|Traceback \().*", re.DOTALL)  # some servers tell where on their disk it went wrong
_CODE = re.compile(r"[A-Za-z][\w.\-]{0,63}")
_MISCONFIGURED = {
    401: ("server_key", "check its api_key"),
    402: ("server_account", "its account has no credit"),
    403: ("server_key", "check its api_key"),
    404: ("server_address", "check its base_url"),
    405: ("server_address", "check its base_url"),
    407: ("server_address", "a proxy in between wants to be told who asks"),
}
"""What the gateway's operator has got wrong, by the server's status."""
MAX_WORDS = 500
MOST_TOKENS = 1_000_000_000
"""No answer takes more: a server that says so has not counted, and sums of it would break the accounts."""
_NO_SECRET = b"\x00 no key has this in it"


class Spent(NamedTuple):
    """How many tokens a server says that an answer took; 0 where it says nothing."""

    prompt: int = 0
    completion: int = 0


class Said(NamedTuple):
    """`message` is the first choice's message, if there is one, in OpenAI's words."""

    message: dict[str, Any] | None
    finish_reason: str | None
    tokens: Spent


class Answer(NamedTuple):
    """`body` is the server's reply as it came."""

    body: bytes
    said: Said


class ReplyReader:
    """For the model `alias`, whose key `secret` must not appear in any message."""

    def __init__(self, alias: str, secret: str | None) -> None:
        self._alias = alias
        self._secret = secret
        self._secret_bytes = secret.encode() if secret else _NO_SECRET

    def said(self, api: Api, body: bytes, headers: Mapping[bytes, bytes]) -> Said:
        """What a 200 holds. Raises ModelUnreachable where it is no chat completion, or the error it really is."""
        try:
            reply = parsed(body)
        except ValueError:
            kind = headers.get(b"content-type", b"no content type").decode("latin-1").split(";")[0][:60]
            raise self.unreachable(f"the reply is no JSON ({kind}, {len(body)} bytes)", "not_json") from None
        if not isinstance(reply, dict):
            raise self.unreachable("the reply is no JSON object", "not_json")
        if (error := error_inside(reply)) is not None:
            raise self.error(error, said_in(headers))
        if api == "other":  # no chat: whatever it is, it may say what it cost
            return Said(None, None, tokens_of(reply.get("usage")))
        said = _ollama(reply) if api == "ollama" else _openai(reply)
        if said is None:
            raise self.unreachable("the reply is no chat completion", "no_completion")
        return said

    def refusal(self, status: int, body: bytes, headers: Mapping[str, str]) -> ModelError:
        """The typed error of an error reply. `details.reason` tells apart what the gateway acts on: `loading` is
        waited for, `declined` is the model's refusal, `structure` is asked again in words only."""
        try:
            reply = json.loads(body)
        except (ValueError, RecursionError):
            reply = None  # HTML pages of proxies tell nobody anything
        return self._typed(status, self._words(reply), headers)

    def error(self, error: object, headers: Mapping[str, str]) -> ModelError:
        """The typed error of an error inside a 200, or inside a stream."""
        return self._typed(status_inside(error), self._words({"error": error}), headers)

    def _typed(self, status: int, words: "_Words", headers: Mapping[str, str]) -> ModelError:
        details: dict[str, Any] = {"model": self._alias, "upstream_status": status}
        if words.said:
            details["upstream_message"] = words.said
        if status in (408, 504):
            message = f"the server of model {self._alias!r} says it took too long ({status})"
            return ModelTimeout(message, details=details)
        loading = status in _LOADING and bool(_LOADING[status].search(words.said))
        if status in (429, 503, 529) or loading:
            return self._overloaded(status, loading, words, headers, details)
        if status == 500 and "validation error" in words.said and _STRUCTURE.search(words.said):
            status = 400  # llama-cpp-python's way to say that it does not know a field's value
        if 400 <= status < 500 or status == 501:
            return self._rejected(status, words, details)
        details["reason"] = "status"
        return ModelUnreachable(f"the server of model {self._alias!r} answers with {status}", details=details)

    def _overloaded(
        self, status: int, loading: bool, words: "_Words", headers: Mapping[str, str], details: dict[str, Any]
    ) -> ModelOverloaded:
        wait_s = retry_after_s(headers.get("Retry-After"))
        if wait_s is not None:
            details["retry_after_s"] = round(wait_s, 3)
        if status == 429:
            message = f"the server of model {self._alias!r} takes no more requests of this account for now (429)"
            limits = {name: value for name, value in headers.items() if name.startswith("x-ratelimit-")}
            return ModelRateLimited(
                f"{message}: {words.said}" if words.said else message,
                retry_after_s=wait_s or 1.0,
                code=words.code,
                details=details,
                headers=limits,
            )
        if loading:
            details["reason"] = "loading"
        state = "still loading" if loading else "overloaded"
        message = f"the server of model {self._alias!r} is {state} ({status})"
        return ModelOverloaded(message, retry_after_s=wait_s or 1.0, details=details)

    def _rejected(self, status: int, words: "_Words", details: dict[str, Any]) -> ModelRejected:
        """A request that is refused: the caller's fault with the server's own status, or the operator's."""
        declined = DECLINED.search(words.kind) or (status in (400, 403) and DECLINED.search(words.said))
        if declined:
            details["reason"] = "declined"
        elif status in (400, 404, 422, 501) and _STRUCTURE.search(words.said):
            details["reason"] = "structure"
        message = f"the server of model {self._alias!r} refuses the request ({status})"
        told = f"{message}: {words.said}" if words.said else message
        if status in _MISCONFIGURED and not declined and not (status == 404 and words.said_by_model):
            reason, way = _MISCONFIGURED[status]
            return ModelMisconfigured(f"{message}; {way}", details={**details, "reason": details.get("reason", reason)})
        if status == 404:
            return ModelNotFound(told, code=words.code, details=details)
        if declined:
            return ModelRejected(told, code=words.code or "content_filter", details=details)
        code = CONTEXT_LENGTH if CONTEXT.search(words.said) else words.code
        # a server that does not implement what was asked for is told in the caller's terms: the request can't be met
        return ModelRejected(told, code=code, status=400 if status == 501 else status, details=details)

    def unreachable(self, what: str, reason: str) -> ModelUnreachable:
        message = f"model {self._alias!r} can't be reached: {what}"
        return ModelUnreachable(message, details={"model": self._alias, "reason": reason})

    def masked(self, text: bytes) -> bytes:
        """`text` without the server's key: servers repeat it in their error messages."""
        return text.replace(self._secret_bytes, b"***") if self._secret_bytes in text else text

    def _words(self, reply: object) -> "_Words":
        """The server's own words, never with our key in them, short, and what it calls the error."""
        if not isinstance(reply, dict):
            return _Words()
        error = error_inside(reply)
        by_model = error is not None
        error = reply if error is None else error
        text: object = error
        kind, code = "", None
        if isinstance(error, dict):
            text = error.get("message") or error.get("detail")
            kind = f"{error.get('type')} {error.get('code')}"
            code = error.get("code")
        if isinstance(text, list):  # FastAPI's list of problems
            text = "; ".join(str(one.get("msg")) for one in text if isinstance(one, dict))
        if not isinstance(text, str):
            return _Words(kind=kind)
        whole = text.replace(self._secret, "***") if self._secret else text
        fits = isinstance(code, str) and _CODE.fullmatch(code) is not None and code != self._secret
        return _Words(_TRACE.sub("", whole)[:MAX_WORDS], kind, code if fits else None, by_model)


class _Words(NamedTuple):
    """What a server says of an error: its words, its type and code in one, its code where it is a word, and whether the
    error is in a form that model servers use (a framework's own 404 is not)."""

    said: str = ""
    kind: str = ""
    code: str | None = None
    said_by_model: bool = False


def said_in(headers: Mapping[bytes, bytes]) -> dict[str, str]:
    """The headers that say something about a reply."""
    said = {
        "Content-Type": headers.get(b"content-type", b"").decode("latin-1"),
        "Retry-After": headers.get(b"retry-after", b"").decode("latin-1"),
    }
    for name, value in headers.items():
        if name.startswith(b"x-ratelimit-"):
            said[name.decode("latin-1")] = value.decode("latin-1")
    return said


def tokens_of(usage: object) -> Spent:
    """The counts in OpenAI's `usage`; 0 where there are none."""
    counts = usage if isinstance(usage, dict) else {}
    prompt, completion = counts.get("prompt_tokens"), counts.get("completion_tokens")
    if type(prompt) is type(completion) is int and 0 <= prompt <= MOST_TOKENS and 0 < completion <= MOST_TOKENS:
        return Spent(prompt, completion)  # as nearly all servers say it
    prompt = counts.get("input_tokens") if prompt is None else prompt
    return Spent(_count(prompt), _count(completion or counts.get("output_tokens")))


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
    message, reason = first.get("message"), first.get("finish_reason")
    return Said(
        message if isinstance(message, dict) else None,
        reason if isinstance(reason, str) else None,
        tokens_of(reply.get("usage")),
    )


def _ollama(reply: dict[str, Any]) -> Said | None:
    """Ollama's native reply: `message` with `thinking`, `done_reason`, and its own names for the tokens."""
    if "message" not in reply or reply.get("done") is False:
        return None
    message = _message(reply["message"])
    if message is not None and message.get("thinking"):
        message = {**message, "reasoning": message["thinking"]}
    tokens = Spent(_count(reply.get("prompt_eval_count")), _count(reply.get("eval_count")))
    return Said(message, _text(reply.get("done_reason")), tokens)


def _message(value: object) -> dict[str, Any] | None:
    return value if isinstance(value, dict) else None


def _text(value: object) -> str | None:
    return value if isinstance(value, str) else None


def _count(value: object) -> int:
    """A number of tokens; 0 where it can't be one."""
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    return value if isinstance(value, int) and not isinstance(value, bool) and 0 <= value <= MOST_TOKENS else 0
