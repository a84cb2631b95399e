"""A run whose episodes are queued in PostgreSQL, flown by workers that are processes, some of which are killed."""

import asyncio
import multiprocessing
import os
import signal
import threading
import time
from contextlib import closing
from pathlib import Path

import pytest
from sqlalchemy.exc import SQLAlchemyError

from contracts.orchestrator import MissionSettings
from evaluation.bench.episode_queue import EpisodeQueue
from evaluation.bench.folder import RunFolder
from evaluation.bench.queue_database import BadDatabase, QueueDatabase
from evaluation.bench.queue_worker import Post, QueueWorker
from evaluation.bench.run import Standing
from evaluation.bench.shard import Shard
from evaluation.bench.worker import Job
from tests.conftest import free_port
from tests.evaluation.bench.made_up_run import SETTINGS, TASKS, Doom, InventiveWorker, fly_made_up
from tests.evaluation.bench.test_bench_process import results, tables
from tests.postgres import Postgres

JOB = Job(folder="", logs="", mission=MissionSettings(), backend="oracle")
PROGRAM = "of today"
SHARD = Shard(number=1, of=4)
MINE = SHARD.share(TASKS)


def work_made_up(post: Post, doom: Doom | None) -> None:
    """A worker's process."""

    async def work() -> None:
        await QueueWorker(post, lambda _: None, lambda job, log: InventiveWorker(doom)).run()

    asyncio.run(work())


def workers(url: str, dooms: list[Doom | None], program: str = PROGRAM) -> list[multiprocessing.process.BaseProcess]:
    # forked from a process that has imported everything
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([fly_made_up.__module__, QueueWorker.__module__])
    post = Post(database=url, program=program, logs="", lost_after_s=1.0, poll_s=0.02)
    started = [context.Process(target=work_made_up, args=(post, doom)) for doom in dooms]
    for one in started:
        one.start()
    return list(started)


def fly_queued(url: str, path: Path, within_s: float, heard: list[Standing], said: list[str]) -> None:
    """A session of the run. Raises TimeoutError where it took too long, and was broken off."""
    with (
        closing(QueueDatabase(url)) as database,
        RunFolder(path, SETTINGS.model_copy(update={"shard": SHARD}), MINE) as folder,
    ):
        queue = EpisodeQueue(database, path, PROGRAM, said.append)
        run = queue.run(folder, JOB, heard.append)
        try:
            asyncio.run(asyncio.wait_for(queue.serve(run.fly()), within_s))
        finally:
            run.conclude()


def queued(url: str) -> int:
    """How many episodes the database holds, flown or not."""
    with closing(QueueDatabase(url)) as database, database.engine.connect() as connection:
        return int(connection.exec_driver_sql("SELECT count(*) FROM dbos.workflow_status").scalar_one())


@pytest.mark.timeout(300)
def test_a_queued_run_whose_workers_are_killed_has_the_tables_of_one_in_a_single_process(
    tmp_path: Path, postgres: Postgres
) -> None:
    url = postgres.database()
    doomed = [Doom(flights=2, then_s=0.001), Doom(flights=4, then_s=0.004)]
    flying = workers(url, [*doomed, None, None])
    heard: list[Standing] = []
    said: list[str] = []
    try:
        fly_queued(url, tmp_path / "queued", 240, heard, said)
    finally:
        for one in flying:
            one.kill()
            one.join()
    assert [one.exitcode for one in flying[:2]] == [-signal.SIGKILL, -signal.SIGKILL]
    fly_made_up(tmp_path / "alone", 4, shard=SHARD)
    assert sorted(results(tmp_path / "queued")) == sorted(task.id for task in MINE)
    assert tables(tmp_path / "queued") == tables(tmp_path / "alone")
    assert heard[-1].done == len(MINE)
    assert queued(url) == 0, "what is in the folder is out of the queue"


@pytest.mark.timeout(300)
def test_a_run_that_was_broken_off_takes_its_episodes_out_of_the_queue_and_goes_on_later(
    tmp_path: Path, postgres: Postgres
) -> None:
    url = postgres.database()
    said: list[str] = []
    flying = workers(url, [None], program="of yesterday")
    try:
        with pytest.raises(TimeoutError):
            fly_queued(url, tmp_path, 2.5, [], said)
        assert queued(url) == 0
        assert results(tmp_path) == [], "its episodes are for workers of its own version"
        assert f"(program {PROGRAM})" in said[0]
        flying += workers(url, [None])
        fly_queued(url, tmp_path, 100, [], said)
    finally:
        for one in flying:
            os.kill(one.pid or 0, signal.SIGKILL)
            one.join()
    assert len(results(tmp_path)) == len(MINE)


def test_a_database_of_one_machine_is_refused() -> None:
    with pytest.raises(BadDatabase, match="sqlite is a database of one machine; give postgresql://"):
        QueueDatabase("sqlite:///queue.sqlite")


def test_a_database_that_does_not_answer_is_told_without_its_password() -> None:
    with pytest.raises(BadDatabase, match="refused") as told:
        QueueDatabase("postgresql://somebody:secret@127.0.0.1:1/queue")
    assert "secret" not in str(told.value)


@pytest.mark.timeout(60)
def test_a_run_whose_database_has_gone_can_be_broken_off(tmp_path: Path) -> None:
    server = Postgres(free_port())
    url = server.database()

    def stop_once_queued() -> None:
        while queued(url) == 0:
            time.sleep(0.05)
        server.stop()

    stopping = threading.Thread(target=stop_once_queued)
    stopping.start()
    try:
        with pytest.raises((TimeoutError, SQLAlchemyError)):
            fly_queued(url, tmp_path, 4, [], [])
    finally:
        stopping.join(10)
        server.close()
    assert results(tmp_path) == []
