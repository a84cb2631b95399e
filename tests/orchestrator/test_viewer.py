"""The viewer's scripts read events as the published schema has them, and stay what they are: small, and without a
build step."""

import re
from collections.abc import Iterator

from contracts.events import json_schema
from contracts.orchestrator import DeliveryResult
from orchestrator.pages import FOLDER, PAGE_POLICY, assets

SCRIPTS = {path.name: path.read_text(encoding="utf-8") for path in sorted(FOLDER.glob("*.js"))}
PAGE = "\n".join(SCRIPTS.values())
SCHEMA = json_schema()
MAX_LINES = 300
MAX_BYTES = 300_000
MAX_COLUMNS = 145


def fields(kind: str) -> set[str]:
    """Names in `data` of a kind of event."""
    event = SCHEMA["$defs"][SCHEMA["discriminator"]["mapping"][kind].rpartition("/")[2]]
    data = SCHEMA["$defs"][event["properties"]["data"]["$ref"].rpartition("/")[2]]
    return set(data.get("properties", {}))


def kinds_named() -> set[str]:
    named = set(re.findall(r'\be\.kind === "(\w+)"', PAGE)) | set(re.findall(r'lastOf\([^"]*"(\w+)"\)', PAGE))
    marks = re.search(r"MARKS = \{(.*?)\}", PAGE, re.DOTALL)
    assert marks is not None
    return named | set(re.findall(r"(\w+):", marks[1]))


def reads() -> Iterator[tuple[str, str]]:
    """What the scripts read of `data`: the kind as which they found the event, and the field."""
    for script in SCRIPTS.values():
        one_kind = r'(\w+) = replay\.last(?:Of\([^"\n]*?"(\w+)"\)|\(index, \(e\) => e\.kind === "(\w+)")'
        found = {name: of or kind for name, of, kind in re.findall(one_kind, script)}
        for name, field in re.findall(r"\b(\w+)\??\.data\.(\w+)", script):
            if name in found:
                yield found[name], field
        for kind, field in re.findall(r'e\.kind === "(\w+)"[^;\n]*?\be\.data\.(\w+)', script):
            yield kind, field


def test_every_kind_that_the_scripts_know_is_written() -> None:
    assert len(kinds_named()) > 10
    assert kinds_named() <= set(SCHEMA["discriminator"]["mapping"])


def test_every_field_that_the_scripts_read_of_a_kind_is_there() -> None:
    read = set(reads())
    assert {("parsed", "answer"), ("look", "returns"), ("verdict", "judged"), ("search", "drawing")} <= read
    assert sorted((kind, field) for kind, field in read if field not in fields(kind)) == []


def test_what_the_scripts_read_of_a_view_and_a_sighting_is_there() -> None:
    judged, view = (set(SCHEMA["$defs"][name]["properties"]) for name in ("JudgedMatch", "LookedView"))
    assert (
        set(re.findall(r"\bs\.(box|camera|rejected|accepted|confidence|distance_m|heading_deg|place)\b", PAGE))
        <= judged
    )
    assert "{ camera, picture, depth }" in PAGE
    assert view == {"camera", "picture", "depth"}


def test_every_field_that_the_scripts_read_of_any_event_is_there_in_some_kind() -> None:
    everywhere = set().union(*(fields(kind) for kind in SCHEMA["discriminator"]["mapping"]))
    assert set(re.findall(r"\.data\.(\w+)", PAGE)) <= everywhere


def test_every_outcome_has_words() -> None:
    words = re.search(r"OUTCOMES = \{(.*?)\n\}", SCRIPTS["wording.js"], re.DOTALL)
    assert words is not None
    outcomes = DeliveryResult.model_json_schema()["properties"]["outcome"]["enum"]
    assert set(re.findall(r"^  (\w+):", words[1], re.MULTILINE)) == set(outcomes)


def test_the_pages_are_small_and_their_modules_short() -> None:
    assert sum(len(asset.data) for asset in assets().values()) < MAX_BYTES
    assert {name: len(text.splitlines()) for name, text in SCRIPTS.items() if text.count("\n") > MAX_LINES} == {}
    assert [line for line in PAGE.splitlines() if len(line) > MAX_COLUMNS] == []


def test_every_module_says_what_it_is_and_imports_its_neighbours_only() -> None:
    for name, text in SCRIPTS.items():
        assert text.startswith("/**"), name
        assert set(re.findall(r'from "([^"]+)"', text)) <= {f"./{other}" for other in SCRIPTS}, name


def test_no_script_makes_markup_of_text_or_asks_elsewhere() -> None:
    assert not re.search(r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|\beval\(|new Function", PAGE)
    assert set(re.findall(r"https?://[^\s\"']+", PAGE)) <= {"http://www.w3.org/2000/svg"}
    for page in FOLDER.glob("*.html"):
        text = page.read_text(encoding="utf-8")
        assert not re.search(r"<style|\bstyle=|\bon\w+=|<script(?![^>]*\bsrc=)", text), page.name
        assert set(re.findall(r'(?:src|href)="(/[^"]*)"', text)) <= {f"/pages/{name}" for name in assets()}
    assert "unsafe" not in PAGE_POLICY
