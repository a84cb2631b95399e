"""The orchestrators' database, once in SQLite and once in PostgreSQL."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from orchestrator.store.database import Database


@pytest.fixture(params=["sqlite", "postgresql"])
def database(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Database]:
    url = f"sqlite:///{tmp_path / 'deliveries.sqlite'}"
    if request.param == "postgresql":
        url = request.getfixturevalue("postgres").database()
    opened = Database(url)
    yield opened
    opened.close()
