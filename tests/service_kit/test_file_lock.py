"""A lock on a file, over real files."""

from pathlib import Path

import pytest

from service_kit.file_lock import HeldElsewhere, hold


def test_one_at_a_time_holds_a_file_until_it_is_closed(tmp_path: Path) -> None:
    path = tmp_path / "lock"
    with path.open("w") as first:
        hold(first)
        with path.open("a") as second, pytest.raises(HeldElsewhere):
            hold(second)
    with path.open("a") as third:
        hold(third)
