"""Typed questions of other packages: routes beside the four, with the same cache, limits, metrics and outcomes.

An entry point (group `logisticsvln.typed_questions`) names a `questions.Kind`; the entry point's name is its path, and
so its route `POST /v1/<name>`. Whoever answers is up to the question: any chat model by `AsksInWords`, a back end
of the package's own by a method of its own. A back end that can't answer is told from one that says no
(`cannot_answer`).
"""

from collections.abc import Callable, Sequence
from typing import Protocol, TypeVar, runtime_checkable

from contracts.vlm_gateway import Answer, Question
from service_kit.errors import BadQuestion
from service_kit.extensions import TYPED_QUESTIONS, BadExtension, extensions, loaded
from services.vlm_gateway.backends.base import Backend, Picture, Reply
from services.vlm_gateway.chat.schemas import Form
from services.vlm_gateway.questions import KINDS, Kind

T = TypeVar("T")
TAKEN = (
    *(kind.path for kind in KINDS),
    *("preflight", "models", "status", "usage", "chat", "completions", "embeddings", "responses", "messages"),
)


@runtime_checkable
class AsksInWords(Protocol):
    """A back end that takes any question as an instruction, pictures and the form of the answer: the chat models."""

    async def ask_in_words(
        self, instruction: str, pictures: Sequence[Picture], form: Form, read: Callable[[object], T]
    ) -> Reply[T]:
        """`read` makes the content of the answer's JSON. It raises `chat.schemas.Unreadable`, whose message goes into
        the one repair question, or `chat.schemas.Declined`."""
        ...


def in_words(backend: Backend) -> AsksInWords:
    """The back end, where it can be asked in words. Raises BadQuestion."""
    if isinstance(backend, AsksInWords):
        return backend
    raise cannot_answer(backend)


def cannot_answer(backend: Backend) -> BadQuestion:
    """What a question raises for a back end that does not know it."""
    return BadQuestion(
        f"a model with the back end {backend.kind!r} can't answer this question; name a chat model, or one that can",
        code="cannot_answer",
    )


def extension_questions() -> tuple[Kind, ...]:
    """Of all installed packages. Raises BadExtension."""
    found: dict[type[Question], Kind] = {kind.question: kind for kind in KINDS}
    for name, point in extensions(TYPED_QUESTIONS, reserved=TAKEN).items():
        kind = loaded(point)
        if not isinstance(kind, Kind):
            raise BadExtension(f"{point.value} ({name!r}) is no services.vlm_gateway.questions.Kind")
        if not issubclass(kind.question, Question) or not issubclass(kind.answer, Answer):
            raise BadExtension(f"{point.value} ({name!r}) asks no contracts.vlm_gateway.Question, or gets no Answer")
        if kind.question in found:
            raise BadExtension(f"{point.value} ({name!r}): {kind.question.__name__} is asked by another route already")
        found[kind.question] = kind._replace(path=name)
    return tuple(found.values())[len(KINDS) :]
