"""A submission: what holds is found sound, what was changed is found out, whether or not it is flown again."""

import asyncio
import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from command_line import submit as submit_command
from command_line.main import app
from command_line.submit import other_versions
from evaluation.bench.folder import BadFolder, RunFolder, read_records, read_settings
from evaluation.bench.run import Run
from evaluation.bench.worker import Job, Order
from evaluation.metrics.episode import EpisodeRecord
from evaluation.spread import spread
from evaluation.submission.claims import Finding, examine, read_submission
from evaluation.submission.outcomes import differing, digest, outcome
from evaluation.submission.replay import fly_again
from evaluation.task_set.task_files import shipped
from tests.evaluation.bench.made_up_run import InventiveWorker
from tests.evaluation.evaluation_kit import a_record, a_result, a_task, delivered, run_settings

COUNT = 12


@pytest.fixture(scope="module")
def made_up(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The first tasks of vld-300, flown by a worker that makes results up from their names."""
    whole = shipped("vld-300")
    tasks = [whole.tasks[k * 25] for k in range(COUNT)]
    settings = run_settings(tasks).model_copy(update={"tasks": whole.name, "checksum": whole.checksum})
    place = tmp_path_factory.mktemp("submission") / "run"
    job = Job(folder=str(place), logs="", mission=settings.mission, backend="embedded")
    with RunFolder(place, settings, tasks) as folder:
        run = Run(folder, job, 2, new_worker=lambda job, log: InventiveWorker(None))
        asyncio.run(run.fly())
        run.conclude()
    return place


@pytest.fixture
def own(made_up: Path, tmp_path: Path) -> Path:
    """A copy, to be tampered with."""
    return Path(shutil.copytree(made_up, tmp_path / "run"))


def rewrite(run: Path, change: Callable[[dict[str, Any]], None]) -> None:
    """Changes the first result in the file."""
    first, *rest = (run / "results.jsonl").read_text().splitlines()
    told = json.loads(first)
    change(told)
    (run / "results.jsonl").write_text("\n".join([json.dumps(told), *rest, ""]))


def problems(run: Path) -> list[Finding]:
    return [finding for finding in examine(read_submission(run)) if not finding.ok]


def test_a_run_as_it_was_flown_holds_what_it_claims(made_up: Path) -> None:
    assert problems(made_up) == []
    told = CliRunner().invoke(app, ["submit", str(made_up)])
    assert told.exit_code == 0, told.output
    assert "ok   task set: vld-300, 12 of 300 tasks" in told.output
    assert "not flown again: add --check" in told.output
    assert f"| {digest(read_records(made_up))[:16]} |" in told.output


def test_what_a_run_was_flown_with_is_told_where_it_is_otherwise_here() -> None:
    flown = {"python": "3.11.7", "commit": "d1bbe27a295d160f", "numpy": "2.3.1"}
    assert other_versions(flown, flown) == ""
    told = other_versions(flown, {"python": "3.11.7", "commit": "a0613d1fffffffff", "pybullet": "3.2.7"})
    assert told == "commit d1bbe27a29 (here a0613d1fff), numpy 2.3.1 (here none), pybullet none (here 3.2.7)"


def test_the_digest_knows_nothing_of_clocks_and_order_and_all_of_outcomes() -> None:
    task = a_task()
    record = a_record(task, delivered())
    other = a_record(a_task("t-2"), delivered())
    later = a_record(task, delivered(timings_s={"total": 9.0}, model_calls={}), wall_s=77.0, started="2027")
    assert digest([record, other]) == digest([other, record])
    assert outcome(later).keys() < outcome(record).keys(), "what was asked of a model is part of it"
    again = a_record(task, delivered(timings_s={"total": 9.0}), wall_s=77.0, started="2027")
    assert digest([again]) == digest([record])
    nearer = a_record(task, delivered(path_m=24.000001))
    assert differing(record, nearer) == {"path_m": "24.0 and 24.000001"}
    assert digest([nearer]) != digest([record])


@pytest.mark.parametrize(
    ("about", "change", "said"),
    [
        ("reasons", lambda told: told.update(reason="collision"), "claims collision, its result says"),
        ("infrastructure", lambda told: told.update(reason="unreachable"), "say nothing of the model"),
        ("complete", lambda told: told.update(task="vld-300-299x"), "that the run has not got"),
        ("summary.json", lambda told: told["result"]["model_calls"]["recognition"].update(calls=9), "model_calls is"),
        ("results.parquet", lambda told: told.update(started="2020"), "started"),
    ],
)
def test_what_was_changed_afterwards_is_found_out(
    own: Path, about: str, change: Callable[[dict[str, Any]], None], said: str
) -> None:
    rewrite(own, change)
    try:
        found = {finding.about: finding.said for finding in problems(own)}
    except BadFolder as error:
        found = {about: str(error)}
    assert about in found, found
    assert said in found[about]
    told = CliRunner().invoke(app, ["submit", "--check", str(own)])
    assert told.exit_code != 0
    assert "Traceback" not in told.output


def test_half_a_run_and_other_tasks_are_told_as_such(own: Path, tmp_path: Path) -> None:
    lines = (own / "results.jsonl").read_text().splitlines()
    (own / "results.jsonl").write_text("\n".join(lines[:5]) + "\n" + lines[5][:40])
    assert next(f.said for f in problems(own)).startswith("5 of 12 tasks are flown; missing: ")
    settings = read_settings(own)
    own_tasks = [a_task(f"t-{n}") for n in range(2)]
    claimed = run_settings(own_tasks).model_copy(update={"tasks": settings.tasks, "checksum": settings.checksum})
    with RunFolder(tmp_path / "foreign", claimed, own_tasks) as folder:
        for task in own_tasks:
            folder.add(a_record(task, delivered()), 1.0)
    assert "differ from vld-300's, whose checksum the run claims" in problems(tmp_path / "foreign")[0].said
    nothing = CliRunner().invoke(app, ["submit", str(tmp_path / "nowhere")])
    assert (nothing.exit_code, "holds no run" in nothing.output) == (2, True)


class ForgetfulWorker(InventiveWorker):
    """The recording lacks the answers of every fourth task."""

    async def fly(self, order: Order) -> EpisodeRecord:
        if int(order.task.id.rpartition("-")[2]) % 100 == 1:
            lost = a_result("model_unreachable", message="this find-object question is not in the recording")
            return a_record(order.task, lost)
        return await super().fly(order)


def test_a_run_flown_again_with_the_same_answers_comes_to_the_same(own: Path, tmp_path: Path) -> None:
    run = read_submission(own)
    tasks = spread(list(run.tasks.values()), None)

    def again(name: str, worker: type[InventiveWorker]):
        made = fly_again(run, tasks, tmp_path / name, {}, {}, 2, new_worker=lambda job, log: worker(None))
        return {flight.task: flight for flight in asyncio.run(made)}

    assert {flight.ending for flight in again("same", InventiveWorker).values()} == {"same"}
    lost = [flight for flight in again("lost", ForgetfulWorker).values() if flight.ending == "not replayed"]
    assert [flight.task for flight in lost] == ["vld-300-001", "vld-300-101", "vld-300-201"]
    assert all("not in the recording" in flight.said for flight in lost)

    def better(told: dict[str, Any]) -> None:
        told["result"]["steps"] -= 1

    rewrite(own, better)
    run = read_submission(own)
    caught = [flight for flight in again("caught", InventiveWorker).values() if flight.ending == "differs"]
    assert len(caught) == 1
    assert caught[0].said == "steps: 3 and 4"


def test_tasks_to_be_flown_again_are_spread_over_the_run(made_up: Path) -> None:
    run = read_submission(made_up)
    assert [task.id for task in spread(list(run.tasks.values()), 3)] == ["vld-300-001", "vld-300-101", "vld-300-201"]
    assert len(spread(list(run.tasks.values()), 99)) == COUNT


def test_a_model_whose_answers_are_not_there_cannot_be_checked(own: Path) -> None:
    settings = json.loads((own / "settings.json").read_text()) | {"backend": "qwen"}
    (own / "settings.json").write_text(json.dumps(settings))
    told = CliRunner().invoke(app, ["submit", "--check", str(own)])
    assert told.exit_code == 2
    assert "has no recording.sqlite, the answers of qwen; name it with --recording" in told.output.replace("\n", " ")
    damaged = own / "answers.vlmrec"
    damaged.write_bytes(b"no recording")
    told = CliRunner().invoke(app, ["submit", "--check", str(own), "--recording", str(damaged)])
    assert told.exit_code == 2
    assert "is no recording, or a damaged one" in told.output.replace("\n", " ")


def test_whoever_checks_needs_no_keys_of_the_models(tmp_path: Path) -> None:
    config = tmp_path / "gateway.toml"
    config.write_text('[models.a]\nbackend = "chat"\napi_key_env = "A_KEY"\n[models.b]\nbackend = "embedded"\n')
    assert submit_command._no_keys({"GATEWAY_CONFIG": str(config)}) == {"A_KEY": "replayed"}
    assert submit_command._no_keys({}) == {}
