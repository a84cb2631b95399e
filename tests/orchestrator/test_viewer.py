"""The viewer's page reads events as the published schema has them."""

import re
from collections.abc import Iterator

from contracts.events import json_schema
from orchestrator.access_routes import HERE

PAGE = (HERE / "viewer.html").read_text(encoding="utf-8")
SCHEMA = json_schema()


def fields(kind: str) -> set[str]:
    """Names in `data` of a kind of event."""
    event = SCHEMA["$defs"][SCHEMA["discriminator"]["mapping"][kind].rpartition("/")[2]]
    data = SCHEMA["$defs"][event["properties"]["data"]["$ref"].rpartition("/")[2]]
    return set(data.get("properties", {}))


def kinds_named() -> set[str]:
    return set(re.findall(r'\.kind === "(\w+)"', PAGE))


def reads() -> Iterator[tuple[str, str]]:
    """What the page reads of `data`: the kind as which it found the event, and the field."""
    one_kind = r'(\w+) = (?:last\(at, |until\.find\()\(e\) => e\.kind === "(\w+)"\)'
    found = dict(re.findall(one_kind, PAGE))
    for name, field in re.findall(r"\b(\w+)\.data\.(\w+)", PAGE):
        if name in found:
            yield found[name], field
    for kind, field in re.findall(r'e\.kind === "(\w+)"[^;]*?\be\.data\.(\w+)', PAGE):
        yield kind, field


def test_every_kind_that_the_page_knows_is_written() -> None:
    assert len(kinds_named()) > 6
    assert kinds_named() <= set(SCHEMA["discriminator"]["mapping"])


def test_every_field_that_the_page_reads_of_a_kind_is_there() -> None:
    read = set(reads())
    assert {("parsed", "answer"), ("placed", "pose"), ("look", "returns"), ("verdict", "judged")} <= read
    assert sorted((kind, field) for kind, field in read if field not in fields(kind)) == []


def test_what_the_page_reads_of_a_view_and_a_sighting_is_there() -> None:
    judged, view = (set(SCHEMA["$defs"][name]["properties"]) for name in ("JudgedMatch", "LookedView"))
    assert set(re.findall(r"\bs\.(box|camera|rejected|accepted|confidence|distance_m|heading_deg)\b", PAGE)) <= judged
    assert "({ camera, picture })" in PAGE
    assert view == {"camera", "picture"}


def test_every_field_that_the_page_reads_of_any_event_is_there_in_some_kind() -> None:
    everywhere = set().union(*(fields(kind) for kind in SCHEMA["discriminator"]["mapping"]))
    assert set(re.findall(r"\.data\.(\w+)", PAGE)) <= everywhere
