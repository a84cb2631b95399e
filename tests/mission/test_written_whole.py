"""A file that is written whole is there, or nothing of it."""

from pathlib import Path

import pytest

from mission.record import write_whole


@pytest.mark.parametrize("content", ["Straße\n", b"\x89PNG\r\n"])
def test_text_and_bytes_are_written_as_they_are(tmp_path: Path, content: str | bytes) -> None:
    write_whole(tmp_path / "it", content)
    assert (tmp_path / "it").read_bytes() == (content.encode() if isinstance(content, str) else content)
    assert [path.name for path in tmp_path.iterdir()] == ["it"]


def test_what_cannot_be_put_in_place_leaves_nothing_and_takes_nothing_away(tmp_path: Path) -> None:
    (tmp_path / "it" / "in").mkdir(parents=True)
    with pytest.raises(OSError, match="it"):
        write_whole(tmp_path / "it", "new")
    assert [path.name for path in tmp_path.iterdir()] == ["it"]
    assert (tmp_path / "it" / "in").is_dir()


def test_half_a_text_is_not_written(tmp_path: Path) -> None:
    (tmp_path / "it").write_text("old")
    with pytest.raises(UnicodeEncodeError):
        write_whole(tmp_path / "it", "new \ud800")
    assert (tmp_path / "it").read_text() == "old"
