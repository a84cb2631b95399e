"""The routes on which models are asked as their servers are: which there are, and what a caller speaks on each."""

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

from fastapi import FastAPI
from fastapi.responses import Response

from contracts.errors import ErrorBody
from service_kit.errors import ServiceError
from services.vlm_gateway.anthropic.adapter import CountAdapter, MessagesAdapter
from services.vlm_gateway.anthropic.answer import MessagesError
from services.vlm_gateway.upstream.forms import CHAT, COMPLETIONS, COUNT, EMBEDDINGS, RESPONSES, Form
from services.vlm_gateway.upstream.replies import Spent


class Adapter(Protocol):
    """Between one exchange's caller, who speaks otherwise, and a chat."""

    def request(self, raw: bytes) -> bytes:
        """The chat that is meant. Raises BadQuestion."""

    def answer(self, body: bytes) -> bytes:
        """A whole answer."""

    def piece(self, piece: bytes) -> bytes:
        """What of a stream's piece is to be told; may be empty."""

    def end(self, used: Spent) -> bytes:
        """The end of a stream that ended well."""

    def error(self, error: ServiceError, request_id: str) -> Response: ...
    def last(self, error: ServiceError, request_id: str) -> bytes:
        """An error as the last event of a stream."""


class Route(NamedTuple):
    """`adapter` makes one for an exchange; None where the caller speaks as the model's server does."""

    path: str
    form: Form
    about: str
    adapter: Callable[[], Adapter] | None = None


_THROUGH = "passed through to a chat model's server; nothing is kept."
ROUTES = (
    Route(
        "/v1/chat/completions",
        CHAT,
        "OpenAI's chat completions for the configured chat models, streamed or not. `x-cache: on` or `off` in the "
        "request overrides that only answers at temperature 0 are cached.",
    ),
    Route(
        "/v1/messages",
        CHAT,
        "Anthropic's messages, streamed or not, of the same models: asked, kept and answered as chats.",
        MessagesAdapter,
    ),
    Route(
        "/v1/messages/count_tokens",
        COUNT,
        "How many tokens Anthropic's message would have, by this gateway's estimate, which budgets reserve by: a token "
        "for four bytes of text, 1000 for a picture. No model is asked.",
        CountAdapter,
    ),
    Route("/v1/completions", COMPLETIONS, f"OpenAI's completions, streamed or not, {_THROUGH}"),
    Route("/v1/responses", RESPONSES, f"OpenAI's responses, streamed or not, {_THROUGH}"),
    Route("/v1/embeddings", EMBEDDINGS, f"OpenAI's embeddings, {_THROUGH}"),
)
BY_PATH = {route.path.encode(): route for route in ROUTES}


def describe(app: FastAPI) -> None:
    """All of them for the API's description: `server.py` sends what is asked on them past the framework."""
    usual = app.router.responses
    # what the connection refuses before it is known what was asked has the usual form there too
    anthropics = {status: {**usual[status], "model": MessagesError | ErrorBody} for status in usual if status != 421}
    anthropics[422] = {**anthropics[422], "description": "not sent here: what is 422 elsewhere is 400"}
    for route in ROUTES:
        app.post(
            route.path,
            response_model=None,
            name=route.path.removeprefix("/v1/").replace("/", "_"),
            description=route.about,
            responses=None if route.adapter is None else anthropics,
        )(_passed)


async def _passed(body: dict[str, Any]) -> Response:
    message = "this app is served by a server that does not know its http_protocol; start it by `serve vlm_gateway`"
    raise ServiceError(message, code="no_protocol", status=503)
