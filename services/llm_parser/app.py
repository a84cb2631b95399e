"""The endpoint of llm_parser: which back end, ask it, encode."""

from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass
from http import HTTPStatus

from fastapi import FastAPI
from fastapi.responses import Response
from prometheus_client import Counter

from contracts.llm_parser import ParseAnswer, ParseQuestion
from service_kit.app import create_app, json_response
from service_kit.errors import BadQuestion, error_answers
from service_kit.metrics import HttpMetrics
from services.llm_parser.port import Parser
from services.llm_parser.reader.parser import MODEL as READER

_ERRORS = error_answers(
    HTTPStatus.TOO_MANY_REQUESTS, HTTPStatus.BAD_GATEWAY, HTTPStatus.GATEWAY_TIMEOUT, HTTPStatus.NOT_FOUND
)
"""What the gateway behind the chat parser answers with."""


@dataclass(frozen=True)
class Parsers:
    """The back ends: the learned `reader`, the `default`, and `chat`, which makes a parser for a gateway's alias (None
    without a gateway)."""

    reader: Parser
    default: Parser
    chat: Callable[[str], Parser] | None

    def choose(self, model: str | None) -> Parser:
        """Raises BadQuestion for an alias that nobody can answer."""
        if model is None:
            return self.default
        if model == READER:
            return self.reader
        if self.chat is None:
            message = f"there is no model {model!r} without a gateway; use {READER!r} or set VLM_GATEWAY_URL"
            raise BadQuestion(message, code="unknown_model")
        return self.chat(model)


async def _nothing() -> None:
    return None


def build_app(
    parsers: Parsers,
    *,
    max_body_bytes: int,
    about: Mapping[str, str] | None = None,
    close: Callable[[], Awaitable[None]] = _nothing,
    token: str | None = None,
) -> FastAPI:
    """The service; it is ready when its default back end is. `about` is told by `/readyz`; `close` is called when
    it stops."""
    metrics = HttpMetrics()
    answers = Counter(
        "llm_parser_answers",
        "Answers by back end, outcome and what was missing.",
        ["backend", "outcome", "missing"],
        registry=metrics.registry,
    )

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        yield
        await close()

    app = create_app(
        "llm_parser",
        max_body_bytes=max_body_bytes,
        checks={"parser": parsers.default.problem},
        about=about,
        token=token,
        metrics=metrics,
        lifespan=lifespan,
    )

    @app.post("/v1/parse", response_model=ParseAnswer, responses=_ERRORS)
    async def parse(question: ParseQuestion) -> Response:
        """The floor and the distinctive object that a request names; what it does not name is listed in `missing`."""
        if not question.request.strip():
            message = "the request is blank; say on which floor and what marks the window"
            raise BadQuestion(message, code="blank_request")
        answer = await parsers.choose(question.model).parse(question)
        backend = answer.model if answer.model == READER else "chat"
        answers.labels(backend, answer.outcome, "+".join(answer.missing) or "nothing").inc()
        return json_response(answer)

    return app
