"""The commands in the documents are there: every target, module, subcommand and option, and the values that these take.

Exempt are commands of others (`docker`, `curl`, `kubectl`), and what a placeholder stands for.
"""

import importlib.util
import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest
import typer
from typer.testing import CliRunner

from command_line.main import COMMANDS, _loaded, app

ROOT = Path(__file__).parent.parent
DOCUMENTS = sorted({*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "training").rglob("*.md")})
FENCED = re.compile(r"^ *```(\w*)[^\n]*\n(.*?)^ *```", re.MULTILINE | re.DOTALL)
SHELLS = ("", "bash", "sh", "shell", "console")
INLINE = re.compile(r"`((?:logisticsvln|make|\.venv/bin/\w+|python -m) [^`\n]+)`")
OURS = re.compile(r"(^|[\s/;|&])(logisticsvln|make|python) ")
CHEAP = {"samples", "tasks stats vld-300"}
ELLIPSIS = ("...", "…")


class Documented(NamedTuple):
    """One command of a document, as words, without what stands before it (`VARIABLE=value`, `.venv/bin/`)."""

    document: str
    words: tuple[str, ...]
    whole: bool
    """It stands in a block of commands, and not in a sentence, where one may lack what it needs."""


def lines_of(text: str) -> Iterator[tuple[str, bool]]:
    """The lines of a document that may be commands, and whether each is a line of its own."""
    text = re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL)
    for language, block in FENCED.findall(text):
        if language in SHELLS:
            yield from ((line.strip(), True) for line in block.replace("\\\n", " ").splitlines())
    yield from ((line, False) for line in INLINE.findall(FENCED.sub("", text)))


def commands_of(document: Path) -> Iterator[Documented]:
    for line, whole in lines_of(document.read_text(encoding="utf-8")):
        if OURS.search(line) is None:
            continue
        for part in _parts(shlex.split(line.removeprefix("$ "), comments=True)):
            while part and re.match(r"[A-Z_0-9]+=", part[0]):
                part = part[1:]
            if part and not part[0].endswith("/") and Path(part[0]).name in ("logisticsvln", "make", "python"):
                yield Documented(document.relative_to(ROOT).as_posix(), (Path(part[0]).name, *part[1:]), whole)


def _parts(words: list[str]) -> Iterator[list[str]]:
    """A line's commands: what stands between `&&`, `;`, `|`."""
    part: list[str] = []
    for word in words:
        if word in ("&&", "||", "|", ";", "&", ">"):
            yield part
            part = []
        else:
            part = [*part, word.rstrip(";")]
    yield part


FOUND = sorted({command for document in DOCUMENTS for command in commands_of(document)})


def problem_of(words: tuple[str, ...], *, whole: bool = True) -> str | None:
    """What is wrong with one of our commands, null where nothing is; `whole`: as it would say itself when it is run,
    with the values of its options, else its words and options alone."""
    name, *rest = words
    if name not in COMMANDS:
        return None if name in ("--help", "-h") else f"there is no command {name}"
    command: Any = _loaded(name)
    while rest and rest[0] in getattr(command, "commands", {}):
        name, *rest = rest
        command = command.commands[name]
    if not whole:
        known = {option for one in command.params for option in (*one.opts, *one.secondary_opts, "--help", "-h")}
        foreign = [word for word in rest if re.match(r"--?[a-z]", word) and word.split("=")[0] not in known]
        return f"{name}: No such option: {foreign[0]}" if foreign else None
    try:
        command.make_context(name, list(rest))
    except typer.Exit:  # --help
        return None
    except Exception as error:
        if not hasattr(error, "format_message"):
            raise
        return f"{name}: {error.format_message()}"
    return None


@pytest.mark.parametrize("command", FOUND, ids=lambda c: f"{c.document}: {' '.join(c.words)}"[:100])
def test_every_command_of_the_documents_is_there(command: Documented) -> None:
    program, *words = command.words
    words = [word for word in words if word not in ELLIPSIS]
    if program == "logisticsvln":
        assert problem_of(tuple(words), whole=command.whole) is None
    elif program == "make":
        targets = set(re.findall(r"^([a-z][\w-]*):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
        assert {word for word in words if "=" not in word and not word.startswith("-")} <= targets
    elif words[:1] == ["-m"]:
        assert importlib.util.find_spec(words[1]) is not None, f"there is no module {words[1]}"


@pytest.mark.parametrize("document", sorted((ROOT / "docs").glob("*.md")), ids=lambda p: p.name)
def test_a_document_says_how_its_commands_come_onto_the_path(document: Path) -> None:
    text = document.read_text(encoding="utf-8")
    lines = [line for language, block in FENCED.findall(text) if language in SHELLS for line in block.splitlines()]
    if any(re.match(r"\s*([A-Z_]+=\S+ )*(logisticsvln|python -m) ", line) for line in lines):
        assert ". .venv/bin/activate" in text


def test_the_documents_have_commands_of_every_kind() -> None:
    assert {command.words[0] for command in FOUND} == {"logisticsvln", "make", "python"}
    assert {command.words[1] for command in FOUND if command.words[0] == "logisticsvln"} >= set(COMMANDS) - {"samples"}


@pytest.mark.parametrize("line", sorted(CHEAP))
def test_what_costs_nothing_runs_as_it_stands(line: str) -> None:
    assert CliRunner().invoke(app, line.split()).exit_code == 0


@pytest.mark.parametrize(
    ("line", "problem"),
    [
        ("bench --limit 3 --bakend oracle", "bench: No such option: --bakend"),
        ("bench --limit 0", "bench: Invalid value for '--limit'"),
        ("export runs/a --format avi", "export: Invalid value for '--format'"),
        ("scene preview", "preview: Missing argument 'file'"),
        ("fly --sample x", "there is no command fly"),
        ("bench merge a b --unfinished --out c", None),
        ("tasks generate --seed 5 --tasks x", "generate: No such option: --tasks"),
    ],
)
def test_a_command_that_is_not_there_is_found(line: str, problem: str | None) -> None:
    said = problem_of(tuple(line.split()))
    assert (said or "").startswith(problem) if problem else said is None
