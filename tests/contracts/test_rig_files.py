"""Rigs from files that are none: each is refused with what is wrong, whatever it is."""

from pathlib import Path

import pytest

from contracts.cameras import BadRig, load_rig

CAMERA = '[[cameras]]\nname = "front"\nwidth = 64\nheight = 64\nhorizontal_fov_deg = 90\n'
BAD = {
    'name = "r"\n' + CAMERA + CAMERA: r"not a rig: rig r: names of cameras must be unique",
    'name = "r"\n' + CAMERA.replace("90", "180"): r"horizontal_fov_deg must lie between 1 and 170, not 180",
    'name = "r"\n' + CAMERA.replace("90", "179.9"): r"horizontal_fov_deg must lie between 1 and 170, not 179.9",
    'name = "r"\n' + CAMERA.replace("90", "true"): r"horizontal_fov_deg must lie between 1 and 170, not True",
    'name = "r"\n' + CAMERA.replace("90", '"wide"'): r"horizontal_fov_deg must lie between 1 and 170, not 'wide'",
    'name = "r"\ncameras = 5': r"cameras must be tables, each headed \[\[cameras\]\]",
    'name = "r"\n[cameras]\nfront = 1': r"cameras must be tables, each headed \[\[cameras\]\]",
    "deep = " + "[" * 30_000: r"is not a rig: it is nested too deeply",
}


@pytest.mark.parametrize("text", BAD, ids=range(len(BAD)))
def test_a_file_that_is_no_rig_is_refused_with_what_is_wrong(tmp_path: Path, text: str) -> None:
    path = tmp_path / "rig.toml"
    path.write_text(text)
    with pytest.raises(BadRig, match=BAD[text]):
        load_rig(str(path))


@pytest.mark.parametrize("name", ["", "a" * 5000, "a\0b", "nosuch", "."])
def test_a_name_that_is_neither_a_rig_nor_a_file_is_refused(name: str) -> None:
    with pytest.raises(BadRig, match=r"is neither a file nor one of the shipped rigs|can't be read"):
        load_rig(name)


def test_a_binary_file_is_no_rig(tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(BadRig, match="it is not a text in UTF-8"):
        load_rig(str(path))
