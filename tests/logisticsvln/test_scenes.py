"""Files of scenes, and what is no file of one."""

from pathlib import Path

import pytest

from logisticsvln import BadScene, read_scene


@pytest.mark.parametrize(
    ("data", "problem"),
    [
        (b"", "is not a scene: Invalid JSON"),
        (b"\xff\xfe\x00", "is not a text file"),
        (b"[1, 2]", "is not a scene: Input should be an object"),
        (b"[" * 100_000, "is not a scene: Invalid JSON: recursion limit"),
        (b'{"name": ' + b"9" * 6000 + b"}", "is not a scene: Invalid JSON: number out of range"),
        (b'{"name": "\\ud800"}', "is not a scene: "),
        (b" " * (4 * 1024 * 1024 + 1), "is larger than 4194304 bytes"),
    ],
)
def test_a_file_that_is_no_scene_is_told_with_what_is_wrong(tmp_path: Path, data: bytes, problem: str) -> None:
    path = tmp_path / "ein Haus.json"
    path.write_bytes(data)
    with pytest.raises(BadScene, match="ein Haus.json " + problem):
        read_scene(path)


@pytest.mark.parametrize(("path", "problem"), [("/dev/zero", "is larger than"), ("/dev/null", "Invalid JSON")])
def test_a_device_is_read_no_further_than_a_scene_goes(path: str, problem: str) -> None:
    with pytest.raises(BadScene, match=problem):
        read_scene(path)
