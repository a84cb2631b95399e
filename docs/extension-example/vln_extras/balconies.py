"""A typed question, `POST /v1/balcony-count`: how many balconies does the picture show? Any chat model answers it."""

from pydantic import Field

from contracts.images import JpegImage
from contracts.vlm_gateway import Answer, Question
from services.vlm_gateway.backends.base import Backend, Picture, Reply
from services.vlm_gateway.chat.schemas import Declined, Form, Unreadable
from services.vlm_gateway.pictures import picture_of
from services.vlm_gateway.question_extensions import in_words
from services.vlm_gateway.questions import Kind, Prepared

VERSION = 1
INSTRUCTION = "How many balconies of the building straight ahead are visible in the picture? null if you can't tell."
FORM = Form(
    "balcony_count",
    {
        "type": "object",
        "properties": {"balconies": {"anyOf": [{"type": "integer", "minimum": 0}, {"type": "null"}]}},
        "required": ["balconies"],
        "additionalProperties": False,
    },
    '{"balconies": <whole number or null>}',
)


class BalconyCountQuestion(Question):
    """How many balconies are visible?"""

    image: JpegImage


class BalconyCountAnswer(Answer):
    """`balconies` is null unless the outcome is `answered`."""

    balconies: int | None = Field(default=None, ge=0)


def read(value: object) -> int:
    """Raises Unreadable or Declined."""
    if not isinstance(value, dict) or "balconies" not in value:
        raise Unreadable('"balconies" is missing')
    count = value["balconies"]
    if count is None:
        raise Declined
    if isinstance(count, bool) or not isinstance(count, int) or count < 0:
        raise Unreadable('"balconies" must be a whole number from 0')
    return count


def prepare(question: BalconyCountQuestion) -> Prepared:
    """What an answer depends on: the wording's version and the picture; both are part of the cache's key."""
    picture: Picture = picture_of(question.image)

    async def ask(backend: Backend) -> Reply[int]:
        return await in_words(backend).ask_in_words(INSTRUCTION, [picture], FORM, read)

    return Prepared({"version": VERSION}, (picture,), ask)


QUESTION = Kind(
    path="balcony-count",
    about="How many balconies are visible in the picture?",
    role="recognition",
    question=BalconyCountQuestion,
    answer=BalconyCountAnswer,
    prepare=prepare,
    fields=lambda count: {"balconies": count},
)
