"""The forms in which model servers put an error into a reply with status 200 or into a stream, and what it stands for.

`{"error": ...}` as an object (OpenAI, OpenRouter, llama.cpp) or a bare string (LM Studio, Ollama);
`{"object": "error"}` (vLLM until 2025) or `{"type": "error"}`; an error inside a choice (OpenRouter, where the model
failed half way); a code and a message alone (DashScope).
"""

import re
from typing import Any

DECLINED = re.compile(
    r"content[_ ]?(?:filter|policy)|data_?inspection|moderation|flagged|safety (?:system|settings|filter)",
    re.IGNORECASE,
)
CONTEXT = re.compile(
    r"context[ _](?:length|window|size)|maximum context|exceeds? the (?:available )?context|prompt is too long|"
    r"too many (?:input )?tokens|max_model_len|n_ctx",
    re.IGNORECASE,
)
_MEANT = [
    (re.compile(words, re.IGNORECASE), status)
    for words, status in (
        ("rate.?limit|ratequota|throttl|too.?many|insufficient.?quota", 429),
        ("overload|unavailable|capacity", 503),
        ("timeout|timed.?out", 504),
        ("not.?found", 404),
        ("auth|api.?key|permission", 401),
        ("credit|billing|payment", 402),
        (f"invalid|bad.?request|context|{DECLINED.pattern}", 400),
    )
]
"""What the type or code of an error inside a 200 stands for."""


def error_inside(reply: dict[str, Any]) -> object:
    """The error that a reply holds, or None."""
    if reply.get("error"):
        return reply["error"]
    if reply.get("object") == "error" or reply.get("type") == "error":
        return reply
    choices = reply.get("choices")
    if isinstance(choices, list):
        first = choices[0] if choices and isinstance(choices[0], dict) else {}
        return first.get("error") or None
    coded = isinstance(reply.get("code"), (str, int)) and isinstance(reply.get("message"), str)
    return reply if coded else None  # DashScope's own form, with neither choices nor `error`


def status_inside(error: object) -> int:
    """The status that an error inside a 200 stands for."""
    if isinstance(error, dict):
        for name in ("code", "status", "status_code"):
            value = error.get(name)
            if isinstance(value, int) and 400 <= value <= 599:
                return value
            if isinstance(value, str) and value.isdigit() and 400 <= int(value) <= 599:
                return int(value)
        words = f"{error.get('type')} {error.get('code')}"
        for meant, status in _MEANT:
            if meant.search(words):
                return status
        error = error.get("message")
    return 400 if isinstance(error, str) and CONTEXT.search(error) else 500
