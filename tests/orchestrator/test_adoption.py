"""Records that other programs have left in the folder come into the list, and cost little once they are there."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
import sqlalchemy as sa

from contracts.orchestrator import Delivery, DeliveryQuestion
from mission.record import Record, failed, new_id, now
from orchestrator.adoption import Adoption
from orchestrator.store.database import Database
from orchestrator.store.deliveries import DeliveryStore
from orchestrator.store.upkeep import UpkeepStore
from tests.mission.block import Block, block_scene


@pytest.fixture
def database(tmp_path: Path) -> Iterator[Database]:
    opened = Database(f"sqlite:///{tmp_path / 'deliveries.sqlite'}")
    yield opened
    opened.close()


def begun(runs: Path) -> Record:
    name = new_id()
    question = DeliveryQuestion(request="floor 4", scene=block_scene(Block()))
    told = Delivery(
        id=name, status="waiting", phase="parse", request="floor 4", scene="block", created=now(), folder=None
    )
    return Record(runs / name, told, question)


def flown(runs: Path) -> str:
    """The name of a record that is over."""
    record = begun(runs)
    result = failed("nobody answers")
    record.conclude(result)
    record.announce(result)
    record.close()
    return record.folder.name


def test_records_are_taken_in_once_and_the_database_is_asked_about_new_ones_only(
    database: Database, tmp_path: Path
) -> None:
    runs, store = tmp_path / "runs", DeliveryStore(database.engine)
    adoption = Adoption(runs, store)
    assert adoption.adopt() == 0, "there is no folder yet"
    names = {flown(runs) for _ in range(3)}
    asked: list[object] = []
    sa.event.listen(database.engine, "before_cursor_execute", lambda *told: asked.append(told[2]))
    assert adoption.adopt() == 3
    assert store.known(sorted(names)) == names
    asked.clear()
    assert adoption.adopt() == 0
    assert asked == []
    assert Adoption(runs, store).adopt() == 0, "another process finds them known"
    later = flown(runs)
    assert adoption.adopt() == 1
    assert store.get(later) is not None


def test_a_record_that_is_still_written_is_taken_in_when_it_is_over(database: Database, tmp_path: Path) -> None:
    adoption = Adoption(tmp_path, DeliveryStore(database.engine))
    record = begun(tmp_path)
    assert adoption.adopt() == 0
    record.close()
    assert adoption.adopt() == 1


def test_a_record_that_was_thrown_away_and_is_put_back_is_taken_in_again(database: Database, tmp_path: Path) -> None:
    runs, kept, store = tmp_path / "runs", tmp_path / "kept", DeliveryStore(database.engine)
    name, adoption = flown(runs), Adoption(runs, store)
    assert adoption.adopt() == 1
    shutil.move(runs / name, kept)
    UpkeepStore(database.engine).delete([name])
    assert adoption.adopt() == 0
    shutil.move(kept, runs / name)
    assert adoption.adopt() == 1
    assert store.get(name) is not None
