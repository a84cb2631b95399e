"""The words of the reader's spelling: an English list by its hash, and what customers write."""

from pathlib import Path

import pytest

from training.parser.rows import Row
from training.parser.vocabulary import AUTHORS, ENGLISH, counts, take_list


def row(text: str, author: str, *tags: str, thing: str | None = None) -> Row:
    return Row(text, 1, thing, (), (), (), None, frozenset(tags), author)


def test_words_of_the_list_are_counted_in_requests_that_are_not_misspelt() -> None:
    rows = [row("the red kite", "a"), row("Kite! teh kite", "b", "typo"), row("red", "c", thing="paper kite")]
    assert counts(rows, ["kite", "red", "zebra"]) == {"kite": 2, "red": 2, "zebra": 0, "paper": 0}


def test_other_words_are_known_where_several_write_them_and_slips_are_not() -> None:
    rows = [row("umberella tulsi umbrella don't", chr(ord("a") + i)) for i in range(AUTHORS)]
    found = counts(rows, ["umbrella"])
    assert found == {"umbrella": AUTHORS, "tulsi": 0, "dont": 0, "don": 0, "t": 0}
    assert "tulsi" not in counts(rows[1:], ["umbrella"])


def test_another_list_of_words_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="holds no"):
        take_list(tmp_path, tmp_path / "base")
    (tmp_path / ENGLISH).parent.mkdir()
    (tmp_path / ENGLISH).write_text("the 3\n")
    with pytest.raises(ValueError, match="has the hash"):
        take_list(tmp_path, tmp_path / "base")
