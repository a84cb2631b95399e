"""The four questions put to any OpenAI-compatible model: ask by preset, read, validate, repair once, typed outcome."""

import asyncio
import logging
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

from contracts.vlm_gateway import Match, Tokens
from service_kit.errors import BadQuestion
from services.vlm_gateway.backends.base import (
    AskedView,
    Building,
    BuildingAsk,
    Direction,
    DirectionAsk,
    Floors,
    FloorsAsk,
    Kind,
    ObjectAsk,
    Picture,
    Reply,
    Sightings,
    shortened,
)
from services.vlm_gateway.chat import dialects, prompts, schemas
from services.vlm_gateway.chat.boxes import Size
from services.vlm_gateway.chat.extract import json_values, looks_like_refusal, without_reasoning
from services.vlm_gateway.config import ChatModel
from services.vlm_gateway.errors import ModelRejected
from services.vlm_gateway.presets import Structured
from services.vlm_gateway.reencode import fresh
from services.vlm_gateway.upstream.client import Completion, Upstream

T = TypeVar("T")
log = logging.getLogger(__name__)


class ChatBackend:
    """One model behind one `Upstream`. Views are asked in one call where the model takes that many pictures, else in
    several calls whose answers are put together. Where the server turns out not to know the dialect in which it is
    asked for an answer's form, it is asked in words only from then on."""

    kind: Kind = "chat"
    cacheable = True

    def __init__(self, model: ChatModel, upstream: Upstream) -> None:
        self.upstream = upstream
        self.settings = model
        family = model.family
        low, high = model.pixel_range
        self._boxes = schemas.BoxForm(family.box_key, model.boxes, model.box_order, model.image_factor, low, high)
        self._structured: Structured = model.structured

    @property
    def model(self) -> str:
        return self.settings.config.model

    @property
    def fingerprint(self) -> dict[str, object]:
        model = self.settings
        return {
            "preset": model.config.preset,
            "preset_version": model.family.version,
            "prompt_version": prompts.VERSION,
            "structured": model.structured,
            "temperature": model.temperature,
            "max_tokens": model.max_tokens,
            "max_images": model.max_images,
            "pixels": list(model.pixel_range),
            "revision": model.config.revision,
            "boxes": [model.boxes, model.box_order, model.image_factor],
            "context_tokens": model.config.context_tokens,
            "extra": model.config.extra,
        }

    async def preflight(self, phrase: str | None) -> str | None:
        self._needs_vision()
        return None

    async def count_floors(self, ask: FloorsAsk) -> Reply[Floors]:
        self._needs_vision()
        picture = await self._fresh(ask.picture)
        return await self._ask(prompts.floors(picture, schemas.floors_form()), schemas.read_floors)

    async def find_building(self, ask: BuildingAsk) -> Reply[Building]:
        self._needs_vision()
        picture = await self._fresh(ask.picture)
        sent = Size(picture.width, picture.height)
        asked = prompts.building(picture, schemas.building_form(self._boxes), self._boxes)
        return await self._ask(asked, lambda value: schemas.read_building(value, self._boxes, sent))

    async def find_object(self, ask: ObjectAsk) -> Reply[Sightings]:
        self._needs_vision()
        views = [AskedView(view.camera, await self._fresh(view.picture)) for view in ask.views]
        limit = self.settings.max_images
        groups = [views[at : at + limit] for at in range(0, len(views), limit)]
        calls = [asyncio.ensure_future(self._find_in(ask.phrase, group)) for group in groups]
        try:
            return _merged(await asyncio.gather(*calls))
        finally:
            for call in calls:
                call.cancel()  # one that failed makes the others' answers useless

    async def choose_direction(self, ask: DirectionAsk) -> Reply[Direction]:
        self._needs_vision()
        labels = [point.label for point in ask.points]
        form = schemas.choice_form(labels)
        asked = prompts.direction(await self._fresh(ask.picture), ask.camera, ask.points, ask.task, form)
        return await self._ask(asked, lambda value: schemas.read_choice(value, labels))

    async def ask_in_words(
        self, instruction: str, pictures: Sequence[Picture], form: schemas.Form, read: Callable[[object], T]
    ) -> Reply[T]:
        """Any other question. `read` raises schemas.Unreadable or schemas.Declined."""
        self._needs_vision()
        if len(pictures) > self.settings.max_images:
            raise BadQuestion(f"model {self.settings.alias!r} takes {self.settings.max_images} pictures at most")
        fresh_ones = [await self._fresh(picture) for picture in pictures]
        return await self._ask(prompts.in_words(instruction, fresh_ones, form), read)

    def status(self) -> dict[str, object]:
        upstream = self.upstream
        return {
            "preset": self.settings.config.preset,
            "server": self.settings.config.server,
            "base_url": self.settings.base_url,
            "structured": self._structured,
            "boxes": self._boxes.style,
            "box_order": self._boxes.order,
            "box_key": self._boxes.key,
            "image_factor": self._boxes.factor,
            "concurrency": self.settings.config.concurrency,
            "queue": self.settings.config.queue,
            "running": upstream.admission.running,
            "waiting": upstream.admission.waiting,
            "breaker": upstream.state,
            "stopped_callers": sorted({name for e in upstream.endpoints for name in e.health.stopped_callers}),
            "servers": [endpoint.status() for endpoint in upstream.endpoints],
            "retries": self.settings.config.retries,
            "retry_budget": round(upstream.budget.left, 1),
            "fallbacks": list(upstream.fallbacks),
        }

    async def close(self) -> None:
        await self.upstream.close()

    async def _find_in(self, phrase: str, views: Sequence[AskedView]) -> Reply[Sightings]:
        asked = prompts.find(phrase, views, schemas.find_form(self._boxes, len(views)), self._boxes)
        return await self._ask(asked, lambda value: schemas.read_find(value, self._boxes, views))

    async def _ask(self, asked: prompts.Asked, read: Callable[[object], T]) -> Reply[T]:
        conversation = prompts.messages(asked, reads_system=self.settings.family.reads_system)
        tokens, attempts = Tokens(), 0
        outcome: T | schemas.Unreadable | schemas.Declined
        try:
            completion = await self._complete(conversation, asked.form)
            tokens, attempts = completion.tokens, completion.attempts
            outcome, text = _understood(completion, read)
            if isinstance(outcome, schemas.Unreadable):
                conversation += prompts.repair(text, str(outcome), asked.form)
                completion = await self._complete(conversation, asked.form)
                tokens, attempts = _sum(tokens, completion.tokens), attempts + completion.attempts
                outcome, text = _understood(completion, read)
        except ModelRejected as error:
            if error.details.get("reason") != "declined":
                raise
            attempts += 1  # a content filter that answers with an error is the model's refusal, told in another way
            outcome, text = schemas.Declined(), str(error.details.get("upstream_message", ""))
        words = shortened(text)
        if isinstance(outcome, schemas.Declined):
            return Reply("refused", text=words, tokens=tokens, attempts=attempts)
        if isinstance(outcome, schemas.Unreadable):
            return Reply("unreadable", text=words, tokens=tokens, attempts=attempts)
        return Reply("answered", outcome, words, tokens, attempts)

    async def _complete(self, conversation: list[prompts.Message], form: schemas.Form) -> Completion:
        try:
            return await self.upstream.ask(dialects.call(self.settings, conversation, form, self._structured))
        except ModelRejected as error:
            if error.details.get("reason") != "structure" or self._structured == "none":
                raise
            said = error.details.get("upstream_message", "")
        completion = await self.upstream.ask(dialects.call(self.settings, conversation, form, "none"))
        alias = self.settings.alias
        log.warning(
            "the server of model %r takes no %s (%s): asked in words from now on", alias, self._structured, said
        )
        self._structured = "none"
        return completion

    async def _fresh(self, picture: Picture) -> Picture:
        server = self.settings.server
        return await asyncio.to_thread(
            fresh,
            picture,
            max_pixels=self.settings.pixel_range[1],
            max_side=server.max_image_side,
            max_bytes=server.max_image_bytes,
        )

    def _needs_vision(self) -> None:
        if not self.settings.family.vision:
            raise BadQuestion(
                f"model {self.settings.alias!r} (preset {self.settings.config.preset!r}) takes no pictures; "
                "name a vision model"
            )


def _understood(
    completion: Completion, read: Callable[[object], T]
) -> tuple[T | schemas.Unreadable | schemas.Declined, str]:
    """The answer's content, or why there is none, and the words it was read from."""
    message = completion.message or {}
    refusal = message.get("refusal")
    if isinstance(refusal, str) and refusal:
        return schemas.Declined(), refusal
    text = _text(message.get("content"))
    if completion.finish_reason == "content_filter":
        return schemas.Declined(), text or "(stopped by the server's content filter)"
    answer = without_reasoning(text).answer
    if not answer:
        return schemas.Unreadable(_why_empty(completion, message, text)), text
    values = json_values(answer)
    if not values and looks_like_refusal(answer):
        return schemas.Declined(), text
    bare = answer.strip(" \t\n\"'`().*")
    if not values and len(bare) == 1:
        values = [bare]  # a label without any wrapping, as small models answer
    try:
        return schemas.first_readable(values, read), text
    except schemas.Unreadable as problem:
        if completion.finish_reason == "length":
            return schemas.Unreadable(f"it was cut off at the length limit ({problem})"), text
        return problem, text
    except schemas.Declined as declined:
        return declined, text


def _why_empty(completion: Completion, message: dict[str, Any], text: str) -> str:
    if text or message.get("reasoning_content") or message.get("reasoning"):
        return "it holds reasoning only and no answer"
    return "it is empty" if completion.message is not None else "the server sent no choice"


def _text(content: object) -> str:
    """Content as text: a string, or the text parts of a list."""
    if isinstance(content, str):
        return content
    if isinstance(content, list):
        parts = [part.get("text") for part in content if isinstance(part, dict) and part.get("type") == "text"]
        return "".join(part for part in parts if isinstance(part, str))
    return ""


def _merged(replies: Sequence[Reply[Sightings]]) -> Reply[Sightings]:
    """One reply of several over disjoint views: what is found anywhere counts; "not found" needs every view read."""
    if len(replies) == 1:
        return replies[0]
    tokens, attempts = Tokens(), 0
    matches: list[Match] = []
    for reply in replies:
        tokens, attempts = _sum(tokens, reply.tokens), attempts + reply.attempts
        matches += reply.content.matches if reply.content else ()
    text = shortened("\n---\n".join(reply.text or "" for reply in replies))
    best_first = tuple(sorted(matches, key=lambda match: -match.confidence)[: schemas.MAX_MATCHES])
    outcomes = {reply.outcome for reply in replies}
    if best_first or outcomes == {"answered"}:
        return Reply("answered", Sightings(best_first), text, tokens, attempts)
    return Reply("unreadable" if "unreadable" in outcomes else "refused", None, text, tokens, attempts)


def _sum(first: Tokens, second: Tokens) -> Tokens:
    return Tokens(prompt=first.prompt + second.prompt, completion=first.completion + second.completion)
