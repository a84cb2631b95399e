"""Server-sent events of OpenAI's responses: each says in `type` what it is, and the last holds the whole response."""

from typing import Any

from services.vlm_gateway.upstream.events import ChatReader, Kind

_CALLS = frozenset({"function_call", "custom_tool_call", "mcp_call", "local_shell_call"})
_REASONS = {"max_output_tokens": "length", "content_filter": "content_filter"}
"""Why a response is incomplete, in the words of chats."""


class ResponsesReader(ChatReader):
    """What a response's events have said so far."""

    def _error_in(self, said: dict[str, Any], named_error: bool) -> object:
        kind = said.get("type")
        if kind == "response.failed":
            response = said.get("response")
            return (response.get("error") if isinstance(response, dict) else None) or said
        if kind == "error" or named_error or not isinstance(kind, str):
            return said.get("error") or said
        return None

    def _only_words(self, said: dict[str, Any]) -> str:
        return ""  # every event is numbered: none is like another

    def _chunk(self, said: dict[str, Any]) -> Kind:
        kind = said["type"]
        if kind in ("response.completed", "response.incomplete"):
            self._over(said.get("response"))
            return "nothing"
        if kind.endswith(".delta"):
            delta = said.get("delta")
            if not delta:
                return "nothing"
            self.has_words = self.has_words or kind == "response.output_text.delta"
            self.has_calls = self.has_calls or "call" in kind
            self.refused = self.refused or kind == "response.refusal.delta"
            self._characters += len(delta) if isinstance(delta, str) else 1
        elif kind == "response.output_item.done":
            item = said.get("item")
            if not isinstance(item, dict) or item.get("type") not in _CALLS:
                return "nothing"
            self.has_calls = True
        else:
            return "nothing"
        self.content_events += 1
        return "content"

    def _over(self, response: object) -> None:
        """It ends, and this is all of it."""
        response = response if isinstance(response, dict) else {}
        details = response.get("incomplete_details")
        why = str(details.get("reason")) if isinstance(details, dict) else ""
        self.done, self.finish_reason = True, _REASONS.get(why, why) or "stop"
        self._count(response.get("usage"))
