"""Lists of deliveries, over SQLite and PostgreSQL."""

import sqlalchemy as sa

from orchestrator.store.database import Database
from orchestrator.store.deliveries import DeliveryStore
from orchestrator.store.lines import Chosen, LineStore
from orchestrator.store.upkeep import UpkeepStore
from tests.orchestrator.store.test_delivery_store import row
from tests.orchestrator.store.test_upkeep import NOW, filled


def test_pages_that_follow_each_other_show_every_delivery_once(database: Database) -> None:
    filled(database, 7)
    seen: list[str] = []
    before = None
    while page := LineStore(database.engine).lines(Chosen(limit=3, before=before)):
        seen += [stored.id for stored in page]
        before = seen[-1]
    assert seen == [f"d{k:02d}" for k in range(6, -1, -1)]


def test_a_list_is_filtered_by_status_time_and_words(database: Database) -> None:
    filled(database, 4)
    DeliveryStore(database.engine).add(row("done", status="done", created=NOW - 60, request="The RED door"))

    def shown(**chosen: object) -> list[str]:
        return [stored.id for stored in LineStore(database.engine).lines(Chosen(limit=10, **chosen))]

    assert shown(status="done") == ["done"]
    assert shown(since=NOW + 1) == ["d03", "d02"]
    assert shown(text="red DOOR") == ["done"]
    assert shown(text="100% blue_") == ["d03", "d02", "d01", "d00"]
    assert shown(text="100_ blue") == [], "what is searched for is taken as it stands"


def test_a_list_leaves_questions_and_states_in_the_database_which_are_nearly_all_of_it(database: Database) -> None:
    filled(database, 2)
    asked: list[str] = []
    sa.event.listen(database.engine, "before_cursor_execute", lambda *told: asked.append(told[2]))
    LineStore(database.engine).lines(Chosen(limit=10))
    UpkeepStore(database.engine).untold(10)
    assert len(asked) == 2
    assert not any(f"deliveries.{column}," in text for text in asked for column in ("question", "state"))
