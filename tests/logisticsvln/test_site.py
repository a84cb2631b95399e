"""The site of the documents: every document has its place, and the API reference names all that is promised."""

import re
from pathlib import Path
from typing import Any

import yaml

import logisticsvln
from scripts.site_links import on_page_markdown

ROOT = Path(__file__).parents[2]


def files_of(nav: Any) -> set[str]:
    """The documents of a navigation tree."""
    if isinstance(nav, str):
        return {nav}
    parts = nav.values() if isinstance(nav, dict) else nav
    return set().union(*(files_of(part) for part in parts))


def test_every_document_has_its_place_in_the_navigation() -> None:
    site = yaml.safe_load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"))
    assert files_of(site["nav"]) | {"index.md"} == {path.name for path in (ROOT / "docs").glob("*.md")}


def test_the_api_reference_names_everything_that_is_promised_and_only_what_is_there() -> None:
    named = re.findall(r"^::: (\S+)$", (ROOT / "docs" / "api.md").read_text(encoding="utf-8"), re.MULTILINE)
    public = {name.removeprefix("logisticsvln.") for name in named if name.count(".") == 1}
    assert public == set(logisticsvln.__all__)


def test_links_that_leave_the_documents_become_names() -> None:
    page = "see [the seeds](../CONTRIBUTING.md#seeds) and [missions](mission.md#how)"
    assert on_page_markdown(page) == "see the seeds (`CONTRIBUTING.md`) and [missions](mission.md#how)"
