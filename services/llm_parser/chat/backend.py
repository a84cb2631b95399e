"""A language model as a parser: asked through the gateway, read with care, asked once more where it can't be read."""

import contextlib
import math
from collections.abc import Mapping
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from contracts.llm_parser import Confidence, Evidence, ParseAnswer, ParseQuestion
from contracts.vlm_gateway import Tokens
from service_kit.client import CallError, Garbled, Refused, ServiceClient, TimedOut
from service_kit.errors import BadQuestion, ServiceError, Unavailable
from services.llm_parser.asking import Known, composed
from services.llm_parser.chat import prompt
from services.llm_parser.chat.grounding import object_span
from services.llm_parser.chat.reading import Read, Refusal, Reply, Unreadable, read_reply
from services.llm_parser.languages import other_language
from services.llm_parser.reader.mentions import find_mentions

ROLE = "parser"
_ROUTE = "/v1/chat/completions"
_MOST_TOKENS = 10**9
_PASSED_ON = frozenset(
    ("model_unreachable", "model_timeout", "model_overloaded", "model_rejected", "not_recorded", "cache_unavailable")
)


class _Question(BaseModel):
    """OpenAI's chat completion, as far as it is used."""

    messages: list[dict[str, str]]
    temperature: float = 0.0
    max_tokens: int
    stream: Literal[False] = False


class _NamedQuestion(_Question):
    """To one alias of the gateway's, rather than to what plays the role `parser` there."""

    model: str


class _Message(BaseModel):
    model_config = ConfigDict(extra="ignore")
    content: str | list[dict[str, Any]] | None = None
    reasoning_content: str | None = None
    reasoning: str | None = None
    refusal: str | None = None

    def text(self) -> str:
        """The content; a list of parts is joined."""
        if isinstance(self.content, list):
            return "".join(str(part.get("text", "")) for part in self.content)
        return self.content or ""


class _Choice(BaseModel):
    model_config = ConfigDict(extra="ignore")
    message: _Message
    finish_reason: str | None = None


class _Completion(BaseModel):
    model_config = ConfigDict(extra="ignore")
    choices: list[_Choice] = Field(min_length=1)
    usage: object = None


class _Bill:
    """What a request costs: the sum over all that the model was asked about it. A server's count that is none, and a
    price that nobody tells, are left out."""

    def __init__(self) -> None:
        self.prompt = self.completion = 0
        self.usd: float | None = None
        self._headers: Mapping[str, str] = {}

    def hear(self, headers: Mapping[str, str]) -> None:
        """Of the answer that `add` counts."""
        self._headers = headers

    def add(self, usage: object) -> None:
        if self._headers.get("x-cache") == "hit":
            return
        if isinstance(usage, dict):
            self.prompt += _count(usage.get("prompt_tokens"))
            self.completion += _count(usage.get("completion_tokens"))
        with contextlib.suppress(ValueError):
            cost = float(self._headers.get("x-cost-usd", ""))
            if math.isfinite(cost) and cost >= 0.0:
                self.usd = (self.usd or 0.0) + cost

    @property
    def tokens(self) -> Tokens:
        return Tokens(prompt=self.prompt, completion=self.completion)


def _count(told: object) -> int:
    return told if isinstance(told, int) and 0 <= told < _MOST_TOKENS else 0


class ChatParser:
    """One alias of the gateway's, or whatever plays the role `parser` there. `client` may be shared between aliases;
    whoever made it closes it."""

    def __init__(
        self,
        client: ServiceClient,
        alias: str | None = None,
        *,
        max_tokens: int = 2048,
        ground_floor: int = 1,
        object_language: prompt.ObjectLanguage = "english",
    ) -> None:
        self._client = client
        self._alias = alias
        self._model = alias or ROLE
        self._max_tokens = max_tokens
        self._ground_floor = ground_floor
        self._object_language = object_language

    async def parse(self, question: ParseQuestion) -> ParseAnswer:
        """Raises Unavailable (model_unreachable, model_overloaded), ServiceError (model_timeout and the gateway's
        further errors) and BadQuestion (unknown_model)."""
        ground = self._ground_floor if question.ground_floor is None else question.ground_floor
        words = "\n".join((question.request, *(e.answer for e in question.exchanges)))
        language = other_language(question.request)
        asked = prompt.question(question.request, ground, question.exchanges, self._object_language)
        messages = [{"role": "user", "content": asked}]
        grounded = language is None or self._object_language == "request"
        bill = _Bill()
        reply = await self._ask(messages, bill)
        found = read_reply(reply, words, grounded=grounded)
        if isinstance(found, Unreadable):
            shown = reply.content[-4000:] or "(no answer)"
            messages += [
                {"role": "assistant", "content": shown},
                {"role": "user", "content": prompt.repair(found.problem)},
            ]
            found = read_reply(await self._ask(messages, bill), words, grounded=grounded)
        answer = self._answer(found, words, language.code if language is not None else "en")
        return answer.model_copy(update={"tokens": bill.tokens, "usd": bill.usd})

    async def problem(self) -> str | None:
        return await self._client.usable()

    def _answer(self, found: Read | Refusal | Unreadable, request: str, language: str) -> ParseAnswer:
        if not isinstance(found, Read):
            outcome: Literal["refused", "unreadable"] = "refused" if isinstance(found, Refusal) else "unreadable"
            return ParseAnswer(outcome=outcome, missing=("floor", "object"), language=language, model=self._model)
        return composed(
            Known(found.floor, "open" if found.floors else "not_said", found.floors),
            Known(found.object, "open" if found.objects else "not_said", found.objects),
            found.relation,
            confidence=Confidence(floor=found.sure, object=found.sure),
            evidence=Evidence(floor=_floor_words(found.floor, request), object=_object_words(found.object, request)),
            language=language,
            model=self._model,
        )

    async def _ask(self, messages: list[dict[str, str]], bill: _Bill) -> Reply:
        question = _Question(messages=messages, max_tokens=self._max_tokens)
        if self._alias is not None:
            question = _NamedQuestion(model=self._alias, messages=messages, max_tokens=self._max_tokens)
        try:
            completion = await self._client.call("POST", _ROUTE, _Completion, question, hear=bill.hear)
        except CallError as error:
            raise self._failure(error) from None
        bill.add(completion.usage)
        choice = completion.choices[0]
        return Reply(
            content=choice.message.text(),
            reasoning=choice.message.reasoning_content or choice.message.reasoning or "",
            refusal=bool(choice.message.refusal) or choice.finish_reason == "content_filter",
            cut=choice.finish_reason == "length",
        )

    def _failure(self, error: CallError) -> ServiceError:
        """What the caller is told: a gateway that can't answer is never an answer."""
        details = {"model": self._model}
        if isinstance(error, TimedOut):
            return ServiceError(str(error), code="model_timeout", status=504, details=details)
        if isinstance(error, Refused):
            if error.code in _PASSED_ON:
                # whatever the model's server has against the question: it is the parser's own, not its caller's
                status = 502 if error.code == "model_rejected" else error.status
                return ServiceError(error.reason, code=error.code, status=status, details=details)
            if error.code in ("unknown_model", "model_not_found") and "upstream_status" not in error.details:
                return BadQuestion(error.reason, code="unknown_model", details={**details, **error.details})
            if error.status == 504:
                return ServiceError(str(error), code="model_timeout", status=504, details=details)
            if error.status == 429:
                return ServiceError(error.reason, code="model_overloaded", status=503, details=details)
            if "upstream_status" in error.details:  # the model's server refused the question, which is the parser's own
                return ServiceError(error.reason, code="model_rejected", status=502, details=details)
        what = "answered with no chat completion" if isinstance(error, Garbled) else error.message
        return Unavailable(f"{error.service}: {what}", code="model_unreachable", details=details)


def _object_words(name: str | None, request: str) -> str | None:
    span = object_span(name, request) if name else None
    return request[span] if span else None


def _floor_words(floor: int | None, request: str) -> str | None:
    """The first number of the request that is this floor."""
    same = (m for m in find_mentions(request) if m.value == floor and m.kind in ("count", "ground"))
    mention = next(same, None)
    return request[mention.start : mention.end] if mention is not None else None
