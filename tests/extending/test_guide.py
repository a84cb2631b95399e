"""docs/extending.md names what there is."""

import re
import tomllib
from pathlib import Path

from mission.policies.base import SearchTools
from service_kit import extensions
from tests.extending.conftest import EXAMPLE

ROOT = Path(__file__).parents[2]
GUIDE = (ROOT / "docs" / "extending.md").read_text(encoding="utf-8")


def test_every_file_that_the_guide_names_or_links_to_is_there() -> None:
    linked = {ROOT / "docs" / target for target in re.findall(r"\]\(([^)#]+)\)", GUIDE)}
    named = {ROOT / path for path in re.findall(r"`([a-z_]+(?:/[a-z_.-]+)+)`", GUIDE)}
    assert len(linked) > 5
    assert len(named) > 5
    assert sorted(path for path in linked | named if not path.exists()) == []


def test_every_heading_that_the_table_links_to_is_there() -> None:
    headings = re.findall(r"^## (.+)$", GUIDE, re.MULTILINE)
    anchors = {re.sub(r"[^a-z0-9 -]", "", heading.lower()).replace(" ", "-") for heading in headings}
    assert set(re.findall(r"\]\(#([^)]+)\)", GUIDE)) <= anchors


def test_the_guide_and_the_example_have_every_group_of_entry_points() -> None:
    groups = {value for value in vars(extensions).values() if str(value).startswith("logisticsvln.")}
    project = tomllib.loads((EXAMPLE / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert groups == set(project["entry-points"])
    assert all(f"`{group}`" in GUIDE for group in project["entry-points"])


def test_the_guide_names_all_that_a_policy_has_of_its_tools_and_all_of_it_is_there() -> None:
    text = (ROOT / "docs" / "python.md").read_text(encoding="utf-8").partition("### Look and tools")[2]
    told = set(re.findall(r"`(?:await )?tools\.(\w+)|`\.(\w+)\(", text.partition("\n## ")[0]))
    there = {name for name in vars(SearchTools) if not name.startswith("_")}
    assert {one or other for one, other in told} == there
