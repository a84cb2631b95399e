"""llm_parser: POST /v1/parse."""

from typing import Literal

from pydantic import Field

from contracts.base import ModelName, Unit, Wire
from contracts.vlm_gateway import Tokens

Side = Literal["left", "right", "above", "below"]
Reason = Literal["not_said", "open", "unsure", "relation_only", "other_language", "too_long"]
"""Why a field is null: the request does not say it; it leaves it open ("4th or 5th") or says it in a way that must not
be guessed; the reader is not sure enough; only a neighbouring window is described; the request is not in English; it is
longer than what is read."""


class Exchange(Wire):
    """A question that was asked about the request, and what the customer said to it."""

    question: str = Field(min_length=1, max_length=500)
    answer: str = Field(min_length=1, max_length=1000)


class ParseQuestion(Wire):
    """`model` names an alias of the service's configuration; without it the service's default is used. `ground_floor`:
    how a plain "first floor" counts, with the ground floor as 0 (Europe) or as 1 (America); null: as the service is
    set up. `exchanges`: what was asked and answered since the request was written."""

    request: str = Field(min_length=1, max_length=4000)
    model: ModelName | None = None
    ground_floor: Literal[0, 1] | None = None
    exchanges: tuple[Exchange, ...] = Field(default=(), max_length=8)


class Evidence(Wire):
    """The words of the request that the answer rests on; null where nothing was found."""

    floor: str | None = None
    object: str | None = None


class Confidence(Wire):
    """The calibrated probability that the field is right, null included; null where a parser gives none."""

    floor: Unit | None = None
    object: Unit | None = None


class Candidates(Wire):
    """Between what the reader wavers, the likeliest first; empty where it does not."""

    floors: tuple[int, ...] = Field(default=(), max_length=3)
    objects: tuple[str, ...] = Field(default=(), max_length=3)


class Reasons(Wire):
    """Why a field is null; null where the field is not."""

    floor: Reason | None = None
    object: Reason | None = None


class Relation(Wire):
    """The customer's window as described by another one: `count` windows to the `side` of the one with `to`, seen from
    outside."""

    to: str = Field(min_length=1, max_length=200)
    side: Side
    count: int = Field(default=1, ge=1, le=20)


class ParseAnswer(Wire):
    """`floor` counts from 1 at the ground; `object` is a lower-case noun phrase without an article, such as "green
    flower pot". What is not said, or not surely enough, is null and named in `missing`: nothing is guessed. Then
    `question` asks the customer for it in a sentence. `outcome` is `unreadable` when a language model answered and its
    answer could not be read, `refused` when it declined. `language`: ISO 639-1, null where a parser does not say.
    `tokens`, `usd`: what a language model used, over all that it was asked, and what that cost by the prices of the
    gateway's configuration; null where that is not known, and where everything came from the cache."""

    outcome: Literal["answered", "unreadable", "refused"] = "answered"
    floor: int | None = Field(default=None, ge=1, le=200)
    object: str | None = Field(default=None, max_length=200)
    relation: Relation | None = None
    missing: tuple[Literal["floor", "object"], ...] = ()
    reasons: Reasons = Reasons()
    candidates: Candidates = Candidates()
    confidence: Confidence = Confidence()
    question: str | None = Field(default=None, max_length=500)
    language: str | None = Field(default=None, pattern=r"^[a-z]{2}$")
    evidence: Evidence = Evidence()
    model: str
    tokens: Tokens = Tokens()
    usd: float | None = Field(default=None, ge=0.0)
