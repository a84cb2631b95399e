"""The routes of a model server, and how what comes back on each is read."""

from collections.abc import Callable
from typing import NamedTuple

from services.vlm_gateway.upstream.events import ChatReader
from services.vlm_gateway.upstream.replies import Api
from services.vlm_gateway.upstream.response_events import ResponsesReader


class Form(NamedTuple):
    """`route` is under the server's address; `reader` reads a stream. `counts_when_asked`: the server says what a
    stream cost where `stream_options` ask for it, else always or never."""

    name: str
    route: str
    api: Api
    reader: Callable[[], ChatReader]
    counts_when_asked: bool


CHAT = Form("chat", "/chat/completions", "openai", ChatReader, True)
COMPLETIONS = Form("completions", "/completions", "other", ChatReader, True)
RESPONSES = Form("responses", "/responses", "other", ResponsesReader, False)
EMBEDDINGS = Form("embeddings", "/embeddings", "other", ChatReader, False)
COUNT = Form("count_tokens", "", "other", ChatReader, False)
"""How long a chat is, which no server is asked."""
