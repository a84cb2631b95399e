"""A page that asks a person the model's questions: the same pictures, the same words, answers of the same form.

    GET  /                        the page
    GET  /questions/next          NextQuestion; `question` is null when all is answered
    GET  /pictures/{number}/{n}   the JPEG `n` of question `number`
    POST /answers/{number}        NextQuestion; PersonAnswer

The person is not told what others answered, nor what is true.
"""

import asyncio
from collections.abc import Callable, Sequence
from importlib.resources import files
from typing import Annotated

import uvicorn
from fastapi import FastAPI, Path
from fastapi.responses import HTMLResponse, Response
from pydantic import Field

from contracts.base import Name, Wire
from contracts.geometry import Box, PointLabel
from contracts.vlm_gateway import Match
from evaluation.offline.answers import AnswerFile
from evaluation.offline.questions import Given, Kind, RecordedQuestion
from service_kit.app import create_app
from service_kit.errors import BadQuestion, NotFound

MAX_BODY_BYTES = 64 * 1024
_STRICT = {
    "Content-Security-Policy": "default-src 'none'; img-src 'self'; style-src 'unsafe-inline'; "
    "script-src 'unsafe-inline'; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "Referrer-Policy": "no-referrer",
}


class AskedPerson(Wire):
    """One question as the page shows it; `views` names the cameras of its pictures."""

    number: int
    kind: Kind
    object: str | None
    task: str | None
    views: tuple[Name, ...]
    labels: tuple[PointLabel, ...]


class NextQuestion(Wire):
    question: AskedPerson | None
    answered: int
    total: int


class DrawnBox(Wire):
    """A box in picture `view` of the question, 0..1."""

    view: int = Field(ge=0, le=63)
    box: Box


class PersonAnswer(Wire):
    """`cannot_tell`: the person declines. Else the field of the question's kind: `boxes` (none: not in sight),
    `floors`, `label`. `seconds`: from when the pictures were there."""

    cannot_tell: bool = False
    boxes: tuple[DrawnBox, ...] | None = Field(default=None, max_length=16)
    floors: int | None = Field(default=None, ge=0, le=100)
    label: PointLabel | None = None
    seconds: float = Field(ge=0.0, le=86_400.0)


Number = Annotated[int, Path(ge=0)]


def build_desk(
    questions: Sequence[RecordedQuestion], answers: AnswerFile, all_answered: Callable[[], None] = lambda: None
) -> FastAPI:
    """The page's app; every answer is in `answers` before it is acknowledged. `all_answered` is called with the last
    one."""
    app = create_app("human_desk", max_body_bytes=MAX_BODY_BYTES)
    page = files("evaluation.offline").joinpath("human_page.html").read_text(encoding="utf-8")

    def upcoming() -> NextQuestion:
        left = answers.pending(questions)
        told = None if not left else _told(questions.index(left[0]), left[0])
        return NextQuestion(question=told, answered=len(questions) - len(left), total=len(questions))

    def known(number: int) -> RecordedQuestion:
        if number >= len(questions):
            raise NotFound(f"there is no question {number}; there are {len(questions)}")
        return questions[number]

    @app.get("/", response_class=HTMLResponse)
    async def show() -> HTMLResponse:
        return HTMLResponse(page, headers=_STRICT)

    @app.get("/questions/next")
    async def ask() -> NextQuestion:
        return upcoming()

    @app.get("/pictures/{number}/{n}")
    async def picture(number: Number, n: Number) -> Response:
        question = known(number)
        if n >= len(question.pictures):
            raise NotFound(f"question {number} has {len(question.pictures)} pictures")
        try:
            data = await asyncio.to_thread(question.jpeg, n)
        except OSError as error:
            raise NotFound(f"picture {question.pictures[n]}: {error.strerror}") from None
        return Response(data, media_type="image/jpeg", headers={"X-Content-Type-Options": "nosniff"})

    @app.post("/answers/{number}")
    async def answer(number: Number, said: PersonAnswer) -> NextQuestion:
        answers.add(_given(known(number), said))
        following = upcoming()
        if following.question is None:
            all_answered()
        return following

    return app


async def serve_desk(port: int, questions: Sequence[RecordedQuestion], answers: AnswerFile) -> None:
    """Until everything is answered, or the task is cancelled."""
    done = asyncio.Event()
    app = build_desk(questions, answers, done.set)
    server = uvicorn.Server(uvicorn.Config(app, host="127.0.0.1", port=port, log_level="warning"))
    serving, waiting = asyncio.create_task(server.serve()), asyncio.create_task(done.wait())
    try:
        await asyncio.wait({serving, waiting}, return_when=asyncio.FIRST_COMPLETED)
    finally:
        waiting.cancel()
        server.should_exit = True  # the answer under way is still given
        await asyncio.wait({serving})


def _told(number: int, question: RecordedQuestion) -> AskedPerson:
    return AskedPerson(
        number=number,
        kind=question.kind,
        object=question.object,
        task=question.task,
        views=tuple(camera.name for camera in question.cameras),
        labels=tuple(point.label for point in question.points),
    )


def _given(question: RecordedQuestion, said: PersonAnswer) -> Given:
    """Raises BadQuestion where the answer is not of the question's kind."""
    common = {"question": question.id, "latency_s": said.seconds}
    if said.cannot_tell:
        return Given(outcome="refused", **common)
    if question.kind == "find-object" and said.boxes is not None:
        if any(drawn.view >= len(question.cameras) for drawn in said.boxes):
            raise BadQuestion(f"boxes: the question has {len(question.cameras)} pictures, numbered from 0")
        matches = tuple(Match(camera=question.cameras[d.view].name, box=d.box) for d in said.boxes)
        return Given(outcome="answered", found=bool(matches), matches=matches, **common)
    if question.kind == "floor-count" and said.floors is not None:
        return Given(outcome="answered", floors=said.floors, **common)
    if question.kind == "choose-direction" and said.label in {point.label for point in question.points}:
        return Given(outcome="answered", label=said.label, **common)
    wanted = {"find-object": "boxes", "floor-count": "floors", "choose-direction": "label, one of those offered"}
    raise BadQuestion(f"a {question.kind} question is answered with {wanted[question.kind]}, or cannot_tell")
