"""OpenAI's other routes, passed through whole: embeddings, completions, responses. No streams, no cache.

The alias becomes the server's name of the model, everything else goes on as it came, but for what would make the server
fetch something, keep something, or answer more than once. Keys, budgets, places, retries and fallbacks are those of
chats.
"""

import json
import time
from collections.abc import Callable, Iterator
from typing import Any, Literal

from fastapi import FastAPI, Request
from fastapi.responses import Response
from pydantic_core import to_json

from service_kit.errors import BadQuestion
from services.vlm_gateway.errors import ModelError
from services.vlm_gateway.hot.calls import Models
from services.vlm_gateway.hot.request import Chat, invalid
from services.vlm_gateway.keys import asking
from services.vlm_gateway.upstream.client import Upstream
from services.vlm_gateway.upstream.replies import Spent
from services.vlm_gateway.usage.accounts import Accounts, Bill, estimated

Route = Literal["embeddings", "completions", "responses"]
ROUTES: tuple[Route, ...] = ("embeddings", "completions", "responses")
WANTED = {"embeddings": "input", "completions": "prompt", "responses": "input"}
LENGTHS = ("max_tokens", "max_output_tokens")


def add_further_routes(app: FastAPI, models: Models, accounts: Accounts) -> None:
    """`POST /v1/embeddings`, `/v1/completions`, `/v1/responses`."""
    for route in ROUTES:
        _add(app, route, models, accounts)


def _add(app: FastAPI, route: Route, models: Models, accounts: Accounts) -> None:
    async def passed(request: Request) -> Response:
        body = checked(route, await request.body())
        chat = Chat(body["model"], body, stream=False)
        return await _asked(route, chat, models.asked(chat, asking.get()), accounts)

    passed.__doc__ = f"OpenAI's {route}, passed through to a chat model's server; no streams."
    app.post(f"/v1/{route}", response_model=None, name=route)(passed)


async def _asked(route: Route, chat: Chat, targets: list[Upstream], accounts: Accounts) -> Response:
    """Target by target, until one answers. Raises OverBudget or ModelError."""
    lengths = [chat.body[name] for name in LENGTHS if isinstance(chat.body.get(name), int)]
    limit = 0 if route == "embeddings" else next(iter(lengths), None)
    for target, last in zip(targets, [*[False] * (len(targets) - 1), True], strict=True):
        sent = to_json({**chat.body, "model": json.loads(target.accepts.model_json)})
        bill = await accounts.reserve(asking.get(), target.alias, estimated(len(sent), 0, limit))
        started = time.perf_counter()
        try:
            answer = await target.whole([sent], None, _marking(bill), f"/{route}", "other")
            bill.settle(answer.said.tokens)
        except ModelError as error:
            bill.settle(Spent())
            accounts.metrics.model_called(target.provider, target.alias, _since(started), error=error.kind)
            if last or error.fallback_reason not in target.fallback_after:
                raise
            continue
        finally:
            bill.given_up()
        accounts.metrics.model_called(target.provider, target.alias, _since(started), answer.said.tokens)
        return Response(answer.body, media_type="application/json", headers={"x-model": target.alias})
    raise AssertionError("there is at least one target")


def _marking(bill: Bill) -> Callable[[], None]:
    """To be told when the model's server is asked."""

    def tell() -> None:
        bill.asked = True

    return tell


def checked(route: Route, raw: bytes) -> dict[str, Any]:
    """The request. Raises BadQuestion."""
    try:
        body = json.loads(raw)
    except ValueError as error:
        raise invalid("body", f"not valid JSON: {str(error)[:200]}") from None
    if not isinstance(body, dict) or not isinstance(body.get("model"), str):
        raise invalid("model", "the alias of a model is wanted; GET /v1/models lists them")
    if body.get(WANTED[route]) is None:
        raise invalid(WANTED[route], "it is missing")
    if body.get("stream"):
        raise invalid("stream", "this route is passed through whole; leave it out, or ask for a chat's stream")
    for name in ("n", "best_of"):
        if body.get(name) not in (None, 1):
            raise invalid(name, "one answer a request is given; send 1 or leave it out")
    for name in ("previous_response_id", "conversation", "background"):
        if body.get(name):
            raise invalid(name, "nothing is kept between requests; send all of the input")
    if any(_fetched(value) for value in _strings_by_url(body)):
        message = "nothing is fetched from an address; send data: URLs"
        raise BadQuestion(message, code="no_urls")
    if route == "responses":
        body["store"] = False
    return body


def _fetched(value: str) -> bool:
    return not value.startswith("data:")


def _strings_by_url(value: object) -> Iterator[str]:
    """What stands, at any depth, under a name that says that it is an address."""
    if isinstance(value, dict):
        for name, inner in value.items():
            if isinstance(inner, str) and (name == "url" or name.endswith("_url")):
                yield inner
            else:
                yield from _strings_by_url(inner)
    elif isinstance(value, list):
        for inner in value:
            yield from _strings_by_url(inner)


def _since(started: float) -> float:
    return time.perf_counter() - started
