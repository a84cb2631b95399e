"""Recorded looks asked again: the same questions, each answered once, agreement told by the answers alone."""

import json
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient
from rich.console import Console
from typer.testing import CliRunner

from command_line.main import app
from command_line.offline import prices_of, print_offline
from contracts.events import FloorCountEvent, LookEvent
from contracts.geometry import Box
from contracts.images import jpeg_bytes
from contracts.vlm_gateway import (
    BuildingBoxAnswer,
    BuildingBoxQuestion,
    ChooseDirectionAnswer,
    ChooseDirectionQuestion,
    FindObjectAnswer,
    FindObjectQuestion,
    FloorCountAnswer,
    FloorCountQuestion,
    Match,
    PreflightAnswer,
    PreflightQuestion,
    Tokens,
)
from evaluation.offline.agreement import Price, agree, overlap, summarize_offline
from evaluation.offline.answers import AnswerFile, ask_all
from evaluation.offline.human_desk import build_desk
from evaluation.offline.questions import Given, NoQuestions, RecordedQuestion, recorded_questions
from evaluation.spread import spread
from mission.ports import ModelUnreachable
from mission.record import read_events

WHO: dict[str, Any] = {"outcome": "answered", "backend": "scripted", "model": "tiny"}


class CountingVision:
    """A model that sees nothing and counts three floors; it is out of reach for the first `away` questions."""

    def __init__(self, away: int = 0) -> None:
        self.asked: list[FindObjectQuestion | FloorCountQuestion] = []
        self._away = away

    async def preflight(self, question: PreflightQuestion) -> PreflightAnswer:
        return PreflightAnswer(model="tiny", backend="scripted")

    async def find_object(self, question: FindObjectQuestion) -> FindObjectAnswer:
        self._hear(question)
        return FindObjectAnswer(role="recognition", found=False, tokens=Tokens(prompt=1000, completion=10), **WHO)

    async def floor_count(self, question: FloorCountQuestion) -> FloorCountAnswer:
        self._hear(question)
        return FloorCountAnswer(role="floors", floors=3, latency_s=0.25, **WHO)

    async def building_box(self, question: BuildingBoxQuestion) -> BuildingBoxAnswer:
        raise AssertionError("its pictures are not kept as they were shown")

    async def choose_direction(self, question: ChooseDirectionQuestion) -> ChooseDirectionAnswer:
        raise AssertionError("the contour search asks none")

    def _hear(self, question: FindObjectQuestion | FloorCountQuestion) -> None:
        self.asked.append(question)
        if len(self.asked) <= self._away:
            raise ModelUnreachable("away")


@pytest.fixture
def questions(run: Path) -> list[RecordedQuestion]:
    return recorded_questions([run / "episodes" / "t-1"])


def test_every_look_and_every_count_of_a_flight_is_a_question_with_its_own_pictures(run: Path) -> None:
    questions = recorded_questions([run])
    events = read_events(run / "episodes" / "t-1")
    asked = [event for event in events if isinstance(event, LookEvent | FloorCountEvent)]
    assert [q.id for q in questions if q.id.startswith("t-1/")] == [f"t-1/{event.number:04d}" for event in asked]
    assert len(questions) == 2 * len(asked)
    for question, event in zip(questions, asked, strict=False):
        put = question.asked("tiny")
        images = [v.image for v in put.views] if isinstance(put, FindObjectQuestion) else [put.image]
        kept = [(run / "episodes" / "t-1" / "pictures" / name).read_bytes() for name in event.pictures]
        assert [jpeg_bytes(image) for image in images] == kept[: len(images)]
        assert question.recorded_by == "geometry"
    assert {q.kind for q in questions} == {"find-object", "floor-count"}
    assert [q.id for q in spread(questions, 2)] == [questions[0].id, questions[len(questions) // 2].id]


async def test_what_is_answered_is_not_asked_again_and_what_was_out_of_reach_is(
    questions: list[RecordedQuestion], tmp_path: Path
) -> None:
    with AnswerFile(tmp_path, "org/tiny") as file:
        first = CountingVision(away=2)
        await ask_all(first, "org/tiny", questions, file, 3)
        assert len(first.asked) == len(questions)
        assert [given.outcome for given in file.given.values()].count("unreachable") == 2
        assert file.trouble == "away"
    path = tmp_path / "org~tiny.jsonl"
    path.write_bytes(path.read_bytes() + b'{"question":"cut o')
    with AnswerFile(tmp_path, "org/tiny") as file:
        second = CountingVision()
        await ask_all(second, "org/tiny", questions, file, 3)
        assert len(second.asked) == 2
        assert {given.outcome for given in file.given.values()} == {"answered"}
    path.write_text("no answer\n")
    with pytest.raises(NoQuestions, match="line 1 is no answer; take the file away"):
        AnswerFile(tmp_path, "org/tiny")


async def test_the_figures_tell_agreement_cost_and_latency_of_each(
    questions: list[RecordedQuestion], tmp_path: Path
) -> None:
    with AnswerFile(tmp_path, "tiny") as file:
        await ask_all(CountingVision(), "tiny", questions, file, 2)
        recorded = {question.id: question.recorded for question in questions}
        found = summarize_offline(questions, {"flown": recorded, "tiny": file.given}, {"tiny": Price(2.0, 10.0)})
    looks, counts = found.questions["find-object"], found.questions["floor-count"]
    seen = sum(bool(question.recorded.found) for question in questions if question.kind == "find-object")
    assert found.agreement["find-object"]["flown"]["flown"].k == looks
    assert found.agreement["find-object"]["flown"]["tiny"].k == looks - seen
    assert found.agreement["find-object"]["tiny"]["flown"] == found.agreement["find-object"]["flown"]["tiny"]
    assert found.figures["find-object"]["tiny"].usd == pytest.approx(looks * (1000 * 2 + 10 * 10) / 1e6)
    assert found.figures["floor-count"]["tiny"].latency_p50_s == 0.25
    assert found.figures["floor-count"]["flown"].usd is None
    assert found.figures["floor-count"]["tiny"].answered == counts


def seen(x_min: float, camera: str = "front") -> Given:
    box = Box(x_min=x_min, y_min=0.2, x_max=x_min + 0.2, y_max=0.4)
    return Given(question="q", outcome="answered", found=True, matches=(Match(camera=camera, box=box),))


def test_two_agree_on_an_object_only_where_they_see_it_in_the_same_place() -> None:
    nowhere = Given(question="q", outcome="answered", found=False)
    assert agree("find-object", nowhere, nowhere)
    assert agree("find-object", seen(0.3), seen(0.35))
    assert not agree("find-object", seen(0.3), seen(0.5))
    assert not agree("find-object", seen(0.3), seen(0.3, "left"))
    assert not agree("find-object", seen(0.3), nowhere)
    one = seen(0.3).matches[0].box
    assert overlap(one, one) == pytest.approx(1.0)
    assert overlap(one, seen(0.4).matches[0].box) == pytest.approx(1 / 3)


@pytest.fixture
def desk(questions: list[RecordedQuestion], tmp_path: Path) -> Iterator[TestClient]:
    with AnswerFile(tmp_path, "human") as file, TestClient(build_desk(questions, file)) as client:
        yield client


def test_a_person_is_asked_one_question_after_the_other_and_each_answer_is_kept(
    desk: TestClient, questions: list[RecordedQuestion], tmp_path: Path
) -> None:
    page = desk.get("/")
    assert page.status_code == 200
    assert "default-src 'none'" in page.headers["content-security-policy"]
    left = desk.get("/questions/next").json()
    for question in questions:
        asked = left["question"]
        assert asked["kind"] == question.kind
        assert desk.get(f"/pictures/{asked['number']}/0").content == question.jpeg(0)
        box = {"x_min": 0.1, "y_min": 0.1, "x_max": 0.2, "y_max": 0.2}
        said = {"boxes": [{"view": 1, "box": box}]} if question.kind == "find-object" else {"floors": 4}
        left = desk.post(f"/answers/{asked['number']}", json=said | {"seconds": 2.5}).json()
    assert left == {"question": None, "answered": len(questions), "total": len(questions)}
    kept = [Given.model_validate_json(line) for line in (tmp_path / "human.jsonl").read_text().splitlines()]
    assert [given.question for given in kept] == [question.id for question in questions]
    looks = {question.id: question for question in questions if question.kind == "find-object"}
    for look in (given for given in kept if given.question in looks):
        assert [match.camera for match in look.matches] == [looks[look.question].cameras[1].name]
    assert {given.latency_s for given in kept} == {2.5}


@pytest.mark.parametrize(
    ("path", "body", "status"),
    [
        ("/answers/0", {"label": "c", "seconds": 1}, 422),
        ("/answers/0", {"seconds": 1}, 422),
        ("/answers/0", {"floors": -1, "seconds": 1}, 422),
        ("/answers/999", {"floors": 1, "seconds": 1}, 404),
        ("/pictures/0/9", None, 404),
    ],
)
def test_an_answer_that_is_none_is_refused_and_nothing_is_kept(
    desk: TestClient, tmp_path: Path, path: str, body: dict[str, object] | None, status: int
) -> None:
    reply = desk.get(path) if body is None else desk.post(path, json=body)
    assert reply.status_code == status, reply.text
    assert reply.json()["error"]["message"]
    assert (tmp_path / "human.jsonl").read_bytes() == b""


def test_who_cannot_tell_has_declined(desk: TestClient, tmp_path: Path) -> None:
    assert desk.post("/answers/0", json={"cannot_tell": True, "seconds": 9}).status_code == 200
    assert json.loads((tmp_path / "human.jsonl").read_text())["outcome"] == "refused"


def test_records_that_can_not_be_asked_about_are_named(own_run: Path, tmp_path: Path) -> None:
    with pytest.raises(NoQuestions, match="neither a record nor a run with pictures"):
        recorded_questions([tmp_path])
    questions = recorded_questions([own_run])
    picture = own_run / "episodes" / "t-1" / "pictures" / questions[0].pictures[0]
    picture.write_bytes(b"GIF89a" + bytes(20))
    with pytest.raises(NoQuestions, match=f"{picture.name}: jpeg_base64 holds a gif picture"):
        questions[0].asked("tiny")
    picture.unlink()
    with pytest.raises(NoQuestions, match=f"{picture.name}: No such file"):
        questions[0].asked("tiny")
    shutil.rmtree(own_run / "episodes" / "t-1" / "pictures")
    (own_run / "episodes" / "t-1" / "question.json").unlink()
    with pytest.raises(NoQuestions, match=r"it has no question\.json"):
        recorded_questions([own_run])


def test_the_command_says_what_is_wrong_before_anybody_is_asked(run: Path, tmp_path: Path) -> None:
    def said(*words: object) -> tuple[int, str]:
        told = CliRunner().invoke(app, ["bench", "--out", str(tmp_path / "out"), *map(str, words)])
        return told.exit_code, told.output.replace("\n", " ")

    code, told = said("--offline", run, "--backend", "embedded,oracle")
    assert (code, "the oracle looks at no picture" in told) == (2, True)
    code, told = said("--offline", tmp_path, "--backend", "embedded")
    assert (code, "neither a record nor a run with pictures" in told) == (2, True)
    code, told = said("--offline", run, "--backend", "embedded,a b")
    assert (code, "--backend 'a b'" in told) == (2, True)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", ["a", "b"])
def test_the_screen_has_a_table_of_what_each_took_and_one_of_who_agrees(
    name: str, questions: list[RecordedQuestion], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recorded = {question.id: question.recorded for question in questions}
    print_offline(Console(width=80), summarize_offline(questions, {"a": recorded, "b": recorded}, {}), tmp_path)
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    looks = sum(question.kind == "find-object" for question in questions)
    assert [name, f"{looks}/{looks}", f"{looks}/{looks}"] in lines
    assert [name, f"{looks}/{looks}", "0", "0", "n/a", "n/a", "0+0", "n/a"] in lines


def test_a_long_name_takes_no_figure_from_a_narrow_screen(
    questions: list[RecordedQuestion], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recorded = {question.id: question.recorded for question in questions}
    priced = {"my-own-model, flown": Price(3.0, 3.0)}
    summary = summarize_offline(questions, {"my-own-model, flown": recorded}, priced)
    print_offline(Console(width=80), summary, tmp_path)
    said = capsys.readouterr().out
    assert "…" not in said
    assert "answered  declined  unreadable  p50 s  p95 s  tokens  US $" in said


def test_prices_are_those_of_the_gateways_configuration(tmp_path: Path) -> None:
    config = tmp_path / "gateway.toml"
    config.write_text('[models.a]\nusd_per_million_prompt = 3\n[models.b]\nbackend = "embedded"\n')
    assert prices_of(str(config)) == {"a": Price(3.0, 0.0)}
    assert prices_of(None) == {}


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("models = 3", "models: Input should be a valid dictionary"),
        ("models = {a = 3}", "models.a"),
        ('[models.a]\nusd_per_million_prompt = "dear"', "models.a.usd_per_million_prompt"),
        ("[models.a]\nusd_per_million_completion = -1", "models.a.usd_per_million_completion"),
        ("[models", "is no TOML"),
        ("\udcff", "is no TOML"),
    ],
)
def test_prices_that_cannot_be_read_are_told_with_file_and_place(tmp_path: Path, text: str, problem: str) -> None:
    config = tmp_path / "gateway.toml"
    config.write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises(ValueError, match=r"GATEWAY_CONFIG: .*gateway\.toml.*" + re.escape(problem)):
        prices_of(str(config))
    with pytest.raises(ValueError, match="nowhere"):
        prices_of(str(tmp_path / "nowhere"))


@pytest.mark.slow
def test_the_embedded_model_is_asked_offline_beside_the_truth(run: Path, tmp_path: Path) -> None:
    words = ["bench", "--offline", str(run), "--limit", "4", "--out", str(tmp_path / "out"), "--json"]
    told = CliRunner().invoke(app, words)
    assert told.exit_code == 0, told.output
    found = json.loads(told.stdout)
    assert set(found["figures"]["find-object"]) == {"truth", "embedded", "geometry, flown"}
    again = CliRunner().invoke(app, words)
    assert json.loads(again.stdout)["agreement"] == found["agreement"]
