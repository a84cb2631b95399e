"""The report over synthetic runs: one page that holds everything and asks nobody for anything."""

import html
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from command_line.report import report
from contracts.depth_assist import ExploreDrawing
from contracts.event_data import LookData, MoveData, PlacedData, SearchData
from contracts.geometry import Point3, Pose
from contracts.images import encode_jpeg, jpeg_bytes
from contracts.orchestrator import Delivery, DeliveryQuestion, DeliveryResult, SearchSettings
from contracts.vlm_gateway import FindObjectAnswer
from evaluation.bench.folder import BadFolder
from evaluation.metrics.episode import EpisodeRecord
from evaluation.metrics.model_calls import RoleCalls
from evaluation.report.failures import failures_of
from evaluation.report.markup import Html, join, tag
from evaluation.report.page import build_page
from evaluation.report.pictures import Album, Shown, edge_for, most_telling
from evaluation.report.runs import label_of, load_runs
from evaluation.subtasks import parse
from evaluation.subtasks.figures import SubtaskScores
from evaluation.task_set.task import Task
from mission.record import Record
from tests.evaluation.evaluation_kit import a_record, a_result, a_run, a_task, a_verdict, delivered, run_settings, stops

CENTRE = SearchSettings(policy="paper", choice="centre")
TASKS = [a_task(f"t-{i}", request=f"Floor <3> & the green pot, no. {i}") for i in range(4)]
VOID = {"meta", "link", "img", "input"}


class Nesting(HTMLParser):
    """Checks that every element is closed in order, and collects what a browser would fetch."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.fetched: list[str] = []
        self.articles: list[dict[str, str | None]] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        self.fetched += [v for k, v in given.items() if k in ("src", "srcset", "data") and v]
        if tag == "link":
            self.fetched.append(given["href"] or "")
        if "failure" in (given.get("class") or ""):
            self.articles.append(given)
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def recorded(run: Path, task: Task, result: DeliveryResult, drawing: ExploreDrawing | None = None) -> EpisodeRecord:
    """A failure with its record on disk: one look with five pictures, in plain view of the window; `drawing` is the
    contour explorer's map."""
    question = DeliveryQuestion(request=task.request, scene=task.scene)
    delivery = Delivery(
        id=task.id, status="waiting", phase="parse", request=task.request, scene="s", created="now", folder=None
    )
    jpeg = jpeg_bytes(encode_jpeg(np.full((800, 800, 3), 90, np.uint8)))
    record = Record(run / "episodes" / task.id, delivery, question)
    ground, pose = Pose(x=10.0, y=-6.0, z=1.5, yaw=3.14), Pose(x=10.0, y=-6.0, z=7.5, yaw=3.14)
    placed = PlacedData(vehicle="e", pose=ground)
    record.write(1, "place", "the drone stands", placed)
    path = (Point3(x=10.0, y=-6.0, z=7.5),)
    moved = MoveData(
        number=1, start=ground, to=pose, path=path, reached=True, collided=False, hit=None, path_m=6.0, flight_s=3.0
    )
    record.write(2, "floors", "to floor 3", moved)
    views = dict.fromkeys(("view-90", "view-45", "view", "view+45", "view+90"), jpeg)
    nothing = FindObjectAnswer(outcome="answered", role="recognition", backend="scripted", model="m", found=False)
    look = LookData(exploration_step=1, pose=pose, object="pot", answer=nothing, render_s=0.1, seconds=0.1)
    record.write(3, "explore", "step 1: no <pot> in sight", look, lambda: views)
    if drawing is not None:
        record.write(4, "explore", "towards facade", SearchData(exploration_step=1, policy="own", drawing=drawing))
    record.conclude(result)
    record.announce(result)
    return a_record(task, result, folder=f"episodes/{task.id}")


@pytest.fixture
def two_runs(tmp_path: Path) -> list[Path]:
    first, second = tmp_path / "first", tmp_path / "second"
    missed = a_result("object_not_found", stops=stops((10.0, -6.0, 3.14)))
    a_run(
        first,
        TASKS,
        [
            a_record(TASKS[0], delivered()),
            a_record(TASKS[1], a_result("wrong_window", a_verdict(right=False))),
            recorded(first, TASKS[2], missed),
            a_record(TASKS[3], None, error="the simulator <ended>"),
        ],
    )
    a_run(second, TASKS, [a_record(task, delivered()) for task in TASKS[:3]], viewpoint=SearchSettings(policy="random"))
    return [first, second]


def parsed(page: str) -> Nesting:
    found = Nesting()
    found.feed(page)
    assert found.open == []
    return found


def test_the_page_holds_every_failure_once_with_its_reason(two_runs: list[Path]) -> None:
    page = build_page(load_runs(two_runs))
    cards = parsed(page).articles
    assert [(card["data-run"], card["data-reason"]) for card in cards] == [
        ("0", "wrong_object"),
        ("0", "missed_object"),
        ("0", "error"),
    ]
    assert page.count('class="plan"') == 3


def test_a_failure_of_the_contour_search_shows_what_it_had_seen_and_what_it_expected(tmp_path: Path) -> None:
    drawing = ExploreDrawing(
        cell_m=0.5,
        inspected=((1.0, 0.0), (1.5, 0.0)),
        uninspected=((2.0, 0.0),),
        expected=((20.0, 3.0),),
        way=((22.0, -2.0), (24.0, 2.0)),
    )
    missed = a_result("object_not_found", stops=stops((10.0, -6.0, 3.14)))
    page = build_page(
        load_runs([a_run(tmp_path / "run", TASKS, [recorded(tmp_path / "run", TASKS[0], missed, drawing)])])
    )
    cells = {kind: path.count("M") for path, kind in re.findall(r'd="([^"]*)" class="cells (\w+)"', page)}
    assert cells == {"inspected": 2, "uninspected": 1, "expected": 1}
    assert page.count('class="meant"') == 1
    parsed(page)


def test_a_failure_whose_record_is_there_leads_to_its_replay(two_runs: list[Path]) -> None:
    runs = load_runs(two_runs[:1])
    kept = next(failure for failure in failures_of(runs) if failure.folder is not None)
    page = build_page(runs)
    assert f'href="http://127.0.0.1:8110/#/delivery/{kept.task.id}"' in page
    assert f"logisticsvln replay {two_runs[0]}" in page


def test_the_page_needs_nothing_from_anywhere(two_runs: list[Path]) -> None:
    page = build_page(load_runs(two_runs))
    found = parsed(page).fetched
    assert len([address for address in found if address.startswith("data:image/jpeg;base64,")]) == 5
    assert all(address.startswith("data:") for address in found)
    replays = r"(?!127\.0\.0\.1:8110/)"  # of this machine, for whoever follows a link
    assert not re.search(rf"https?://{replays}|@import|url\(", page)


def test_what_people_wrote_is_shown_and_never_run(two_runs: list[Path]) -> None:
    page = build_page(load_runs(two_runs))
    assert html.escape(TASKS[1].request) in page
    assert "no &lt;pot&gt; in sight" in page
    assert "&lt;ended&gt;" in page
    assert "<pot>" not in page
    assert "<ended>" not in page


def test_the_papers_five_tables_stand_beside_ours(two_runs: list[Path]) -> None:
    page = build_page(load_runs(two_runs))
    for printed in ("54.7", "50.8", "12.15", "61.6", "15.9", "53.3", "24.0", "8.42", "53.8", "12.29"):
        assert f"<b>{printed}</b>" in page
    # our one success of four, and the ablation that was not flown with the command that flies it
    assert "1/4 · " in page
    assert "logisticsvln bench --backend embedded --viewpoint default" in page
    # three tasks in common, two that only the second solved: p = 2 / 2^2
    assert "p 0.500" in page


def test_pictures_take_no_more_room_than_they_were_given(two_runs: list[Path]) -> None:
    page = build_page(load_runs(two_runs), limit_bytes=0)
    assert "data:image/jpeg" not in page
    assert "2 pictures left out" in page


def test_an_album_scales_down_and_counts_what_it_leaves_out(tmp_path: Path) -> None:
    path = tmp_path / "big.jpg"
    path.write_bytes(jpeg_bytes(encode_jpeg(np.random.default_rng(1).integers(0, 255, (600, 600, 3), np.uint8))))
    album = Album(8, limit_bytes=60_000)
    first = album.picture(path, "noise")
    assert first is not None
    assert len(first.source) < path.stat().st_size / 4
    while album.picture(path, "more") is not None:
        pass
    assert album.left_out == 1
    assert album.used_bytes <= 60_000
    assert album.picture(tmp_path / "gone.jpg", "gone") is None
    assert [edge_for(n) for n in (0, 300, 10**6)] == [400, 400, 160]
    assert 160 < edge_for(2000) < 400


def test_many_failures_show_fewer_pictures_each_and_those_that_tell_most() -> None:
    look = [Shown(f"0001_view{h:+d}.jpg", str(h), rank) for h, rank in ((-90, 5), (-45, 4), (0, 3), (45, 1), (90, 2))]
    assert most_telling([look] * 3) == [look] * 3
    many = most_telling([look] * 2000)
    assert len(many) == 2000
    assert [one.caption for one in many[0]] == ["45", "90"]


def test_an_album_gives_every_planned_picture_room_even_where_all_take_more_than_usual(tmp_path: Path) -> None:
    path = tmp_path / "big.jpg"
    coarse = np.random.default_rng(1).integers(0, 255, (50, 50, 3), np.uint8)
    path.write_bytes(jpeg_bytes(encode_jpeg(np.kron(coarse, np.ones((16, 16, 1), np.uint8)))))
    album = Album(60, limit_bytes=1_200_000)
    shown = [album.picture(path, "noise") for _ in range(60)]
    assert None not in shown
    assert album.left_out == 0
    assert album.used_bytes <= 1_200_000


def test_a_run_without_results_still_has_a_page(tmp_path: Path) -> None:
    page = build_page(load_runs([a_run(tmp_path / "empty", TASKS, [])]))
    parsed(page)
    assert "No episode failed." in page


def test_a_folder_outside_the_run_is_never_read(tmp_path: Path, two_runs: list[Path]) -> None:
    outside = a_record(TASKS[1], a_result("blocked"), folder="../first/episodes/t-2")
    page = build_page(load_runs([a_run(tmp_path / "third", TASKS, [outside])]))
    assert "data:image/jpeg" not in page


def test_the_figures_of_single_roles_are_shown_where_a_run_has_them(two_runs: list[Path]) -> None:
    assert "Each role alone" not in build_page(load_runs(two_runs))
    figures = parse.score([parse.Parsed("plain", 3, "vase", 3, "vase"), parse.Parsed("plain", 3, "vase", 4, "vase")])
    scores = SubtaskScores(
        subtask="parse",
        backend="embedded",
        model="rules",
        tasks=2,
        questions=2,
        skipped=0,
        model_calls=RoleCalls(),
        wall_s=1.0,
        **figures._asdict(),
    )
    (two_runs[0] / "parse.json").write_text(scores.model_dump_json())
    page = build_page(load_runs(two_runs))
    parsed(page)
    assert "Each role alone" in page
    assert "50.0 (1/2)" in page
    (two_runs[0] / "parse.json").write_text("{}")
    with pytest.raises(BadFolder, match=r"parse\.json"):
        load_runs(two_runs)


def test_our_tables_say_at_how_many_tasks_the_infrastructure_failed(tmp_path: Path) -> None:
    records = [a_record(TASKS[0], delivered()), a_record(TASKS[1], a_result("model_unreachable"))]
    page = build_page(load_runs([a_run(tmp_path / "a", TASKS, records)]))
    assert page.count("<th>Infrastructure failures</th>") == 5  # in each of the five
    assert "<b>1</b><small>of 2 tasks</small>" in page


def test_runs_with_equal_arms_are_told_apart_by_their_folders(tmp_path: Path) -> None:
    runs = load_runs([a_run(tmp_path / "a", TASKS, []), a_run(tmp_path / "b", TASKS, [])])
    assert [run.label for run in runs] == ["embedded, paper's rule (a)", "embedded, paper's rule (b)"]


def test_a_label_says_what_differs_from_the_papers_method() -> None:
    assert label_of(run_settings(TASKS)) == "embedded, paper's rule"
    assert (
        label_of(run_settings(TASKS, viewpoint=CENTRE, floors="direct-count"))
        == "embedded, paper's rule, centre, no choice, direct count"
    )
    noisy = run_settings(TASKS).model_copy(
        update={"backend": "oracle", "oracle": {"miss_rate": 0.2, "noise_seed": 4.0}}
    )
    assert label_of(noisy) == "oracle, miss rate 0.2, paper's rule"


def test_the_command_writes_the_page_and_says_where(two_runs: list[Path], tmp_path: Path) -> None:
    app = typer.Typer()
    app.command()(report)
    out = tmp_path / "page.html"
    done = CliRunner().invoke(app, [*map(str, two_runs), "--out", str(out)])
    assert done.exit_code == 0, done.output
    assert done.output.strip() == str(out)
    parsed(out.read_text(encoding="utf-8"))
    bad = CliRunner().invoke(app, [str(tmp_path)])
    assert bad.exit_code == 2
    assert "holds no run" in bad.output


def test_markup_escapes_texts_and_attributes_once() -> None:
    assert tag("p", "a < b", Html("<b>c</b>"), title='say "x"') == '<p title="say &quot;x&quot;">a &lt; b<b>c</b></p>'
    assert tag("img", src="x", hidden=None) == '<img src="x">'
    assert join(["<", 1]) == "&lt;1"
