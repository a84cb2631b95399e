"""Files of labelled requests are read, asked about, and scored by file and by tag."""

import json
from pathlib import Path

import pytest

from contracts.llm_parser import ParseAnswer, ParseQuestion
from evaluation.labelled_requests.ask import ask_parser
from evaluation.labelled_requests.read import BadRequests, read_requests
from evaluation.labelled_requests.scores import misses, score
from mission.ports import ModelUnreachable, ServiceRefused

ROWS = [
    {"text": "floor 4, the green pot", "floor": 4, "object": "green pot", "tags": ["plain"], "relation": None},
    {"text": "floor 5, the green pot", "floor": 4, "object": "green pot", "tags": ["plain", "odd"]},
    {"text": "the green pot", "floor": 2, "object": "green pot", "tags": ["odd"]},
    {"text": "away", "floor": 2, "object": "green pot", "tags": ["odd"]},
]


class Pattern:
    """Reads "floor N" and "green pot"; cannot be reached about "away"."""

    async def parse(self, question: ParseQuestion) -> ParseAnswer:
        text = question.request
        if text == "away":
            raise ModelUnreachable("gone")
        floor = int(text[6]) if text.startswith("floor") else None
        missing = ("floor",) if floor is None else ()
        return ParseAnswer(
            floor=floor, object="green pot", missing=missing, question="Which?" if missing else None, model="pattern"
        )


def write(path: Path, rows: list[dict[str, object]]) -> Path:
    path.write_text("\n".join(json.dumps(row) for row in rows) + "\n\n", encoding="utf-8")
    return path


async def test_every_request_is_counted_once_by_file_and_with_each_of_its_tags(tmp_path: Path) -> None:
    files = [write(tmp_path / "a.jsonl", ROWS[:2]), write(tmp_path / "b.jsonl", ROWS[2:])]
    heard: list[int] = []
    asked = await ask_parser(Pattern(), read_requests(files), at_a_time=2, told=heard.append)
    scores = score(asked, at_a_time=2, wall_s=1.0)
    assert sorted(heard) == [1, 2, 3, 4]
    assert (scores.all.right.k, scores.all.asks.k, scores.all.silently_wrong.k, scores.all.requests) == (1, 1, 1, 3)
    assert {name: group.requests for name, group in scores.files.items()} == {str(files[0]): 2, str(files[1]): 1}
    assert {name: (group.requests, group.right.k) for name, group in scores.tags.items()} == {
        "odd": (2, 0),
        "plain": (2, 1),
    }
    assert scores.all.right.low < scores.all.right.rate < scores.all.right.high
    assert scores.calls.unreachable == 1
    assert scores.model == "pattern"
    assert scores.ms_mean is not None


async def test_what_was_missed_is_told_with_its_place_and_the_question(tmp_path: Path) -> None:
    file = write(tmp_path / "a.jsonl", ROWS)
    missed = misses(await ask_parser(Pattern(), read_requests([file])))
    assert [(miss.line, miss.outcome, miss.floor, miss.floor_read) for miss in missed] == [
        (2, "silently_wrong", 4, 5),
        (3, "asks", 2, None),
    ]
    assert missed[1].question == "Which?"


class Refuses:
    async def parse(self, question: ParseQuestion) -> ParseAnswer:
        raise ServiceRefused("llm_parser: there is no model 'x'", code="unknown_model", status=422)


async def test_a_parser_that_refuses_ends_the_asking(tmp_path: Path) -> None:
    requests = read_requests([write(tmp_path / "a.jsonl", ROWS)])
    with pytest.raises(ServiceRefused):
        await ask_parser(Refuses(), requests, at_a_time=3)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "holds no requests"),
        ('{"text": "x", "floor": 1, "object": null}\n{"text"', "line 2"),
        ('{"text": "x", "floor": "one", "object": null}', "line 1: floor"),
        ('{"text": "x", "object": null}', "line 1: floor"),
    ],
)
def test_a_file_that_holds_no_labelled_requests_is_told_with_its_line(tmp_path: Path, text: str, said: str) -> None:
    file = tmp_path / "bad.jsonl"
    file.write_text(text)
    with pytest.raises(BadRequests, match=said):
        read_requests([file])


def test_a_file_that_is_not_there_is_told(tmp_path: Path) -> None:
    with pytest.raises(BadRequests, match="No such file"):
        read_requests([tmp_path / "none.jsonl"])
