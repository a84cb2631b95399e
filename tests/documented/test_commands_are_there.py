"""The commands in the documents are there: every target, module, subcommand and option, and the values that these take.

Each is read by the program that it names, up to where it would begin; what a placeholder stands for is exempt.
"""

import argparse
import importlib.util
import re
import runpy
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any, NoReturn

import pytest
import typer

from command_line.main import COMMANDS, _loaded
from tests.documented.commands import DOCUMENTS, FOUND, ROOT, Documented, blocks_of

ELLIPSIS = ("...", "…")
PLACEHOLDER = re.compile(r"[A-Z]{4,}$")
MODULES_WITHOUT_OPTIONS = {
    "command_line": "the command itself",
    "command_line.main": "the command itself, by a name that the changelog tells is gone",
    "services.vlm_gateway": "takes its settings from the environment",
    "services.vlm_gateway.keys": "takes a name",
    "tests.services.vlm_gateway.hot.faults": "takes nothing",
    "training": "imports PyTorch; `make test-train` reads its options",
    "contracts.events": "takes nothing",
    "contracts.scene_schema": "takes nothing",
    "scripts.configuration": "takes nothing",
}


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


class Begins(BaseException):
    """A program has read its options and would begin."""


def has_a_parser(module: str) -> bool:
    found = importlib.util.find_spec(module)
    assert found is not None
    folder = found.submodule_search_locations
    program = Path(folder[0]) / "__main__.py" if folder else Path(found.origin or "")
    return "parse_args" in program.read_text(encoding="utf-8")


def problem_of_module(module: str, words: list[str]) -> str | None:
    """What a module's own parser says against these words, null where it takes them."""
    if importlib.util.find_spec(module) is None:
        return f"there is no module {module}"
    if module in MODULES_WITHOUT_OPTIONS:
        return None
    if not has_a_parser(module):
        return f"{module} reads no options: say in MODULES_WITHOUT_OPTIONS what it takes"
    read = argparse.ArgumentParser.parse_args

    def read_and_stop(parser: argparse.ArgumentParser, *given: Any, **more: Any) -> NoReturn:
        read(parser, *given, **more)
        raise Begins

    def refuse(parser: argparse.ArgumentParser, message: str) -> NoReturn:
        raise argparse.ArgumentTypeError(message)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", [module, *words])
        for imported in (module, f"{module}.__main__"):  # another test may have
            patch.delitem(sys.modules, imported, raising=False)
        patch.setattr(argparse.ArgumentParser, "parse_args", read_and_stop)
        patch.setattr(argparse.ArgumentParser, "error", refuse)
        try:
            runpy.run_module(module, run_name="__main__", alter_sys=False)
        except Begins:
            return None
        except argparse.ArgumentTypeError as error:
            return f"{module}: {error}"
    return f"{module} reads no options"


def problem_of_tests(words: list[str]) -> str | None:
    """What is wrong with a run of tests: a marker or a folder that there is not."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["pytest"]["ini_options"]
    markers = {marker.partition(":")[0] for marker in settings["markers"]}
    asked = words[words.index("-m") + 1] if "-m" in words else ""
    if unknown := set(re.findall(r"\w+", asked)) - markers - {"or", "and", "not"}:
        return f"there is no marker {unknown}"
    missing = [word for word in words if word.startswith("tests") and not (ROOT / word).exists()]
    return f"there is no {missing[0]}" if missing else None


def recipe_of(words: list[str]) -> list[tuple[str, ...]]:
    """What `make` would run of ours for these words, as commands. Fails where it has no such target."""
    asked = subprocess.run(["make", "-n", "-o", "setup", *words], cwd=ROOT, capture_output=True, text=True)
    assert asked.returncode == 0, asked.stderr
    lines = asked.stdout.replace("\\\n", " ").splitlines()
    split = [shlex.split(line) for line in lines if re.match(r"\.venv/bin/(logisticsvln|python -m) ", line)]
    return [(Path(line[0]).name, *line[1:]) for line in split]


def check(words: tuple[str, ...], *, whole: bool) -> str | None:
    """What is wrong with a command of ours, null where nothing is; those of others are not looked into."""
    program, *rest = [word for word in words if word not in ELLIPSIS]
    if rest[:2] == ["-m", "pytest"]:
        return problem_of_tests(rest[2:])
    if program == "logisticsvln":
        return problem_of(tuple(rest), whole=whole)
    if program == "python" and rest[:1] == ["-m"]:
        left_open = any(PLACEHOLDER.fullmatch(word) for word in rest[2:])
        said = None if left_open else problem_of_module(rest[1], rest[2:])
        return None if said and not whole and said.endswith("expected one argument") else said
    return None


@pytest.mark.parametrize("command", FOUND, ids=lambda c: f"{c.document}: {c.line}"[:100])
def test_every_command_of_the_documents_is_there(command: Documented) -> None:
    if command.words[0] == "make":
        targets = set(re.findall(r"^([a-z][\w-]*):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
        assert {word for word in command.words[1:] if "=" not in word and not word.startswith("-")} <= targets
    else:
        assert check(command.words, whole=command.whole) is None


MADE = sorted({command.words[1:] for command in FOUND if command.words[0] == "make"})


@pytest.mark.parametrize("words", MADE, ids=" ".join)
def test_what_a_documented_target_runs_is_there_with_the_options_that_a_document_gives_it(
    words: tuple[str, ...],
) -> None:
    for command in recipe_of(list(words)):
        assert check(command, whole=True) is None


@pytest.mark.parametrize("document", sorted((ROOT / "docs").glob("*.md")), ids=lambda p: p.name)
def test_a_document_says_how_its_commands_come_onto_the_path(document: Path) -> None:
    lines = [line for block in blocks_of(document) for line in block.splitlines()]
    if any(re.match(r"\s*([A-Z_]+=\S+ )*(logisticsvln|python -m) ", line) for line in lines):
        assert ". .venv/bin/activate" in document.read_text(encoding="utf-8")


def test_the_documents_have_commands_of_every_kind() -> None:
    assert {command.words[0] for command in FOUND} == {"logisticsvln", "make", "python", "curl"}
    assert {command.words[1] for command in FOUND if command.words[0] == "logisticsvln"} >= set(COMMANDS) - {"samples"}
    assert len(DOCUMENTS) > 25


@pytest.mark.parametrize(
    ("line", "problem"),
    [
        ("logisticsvln bench --limit 3 --bakend oracle", "bench: No such option: --bakend"),
        ("logisticsvln bench --limit 0", "bench: Invalid value for '--limit'"),
        ("logisticsvln export runs/a --format avi", "export: Invalid value for '--format'"),
        ("logisticsvln scene preview", "preview: Missing argument 'file'"),
        ("logisticsvln fly --sample x", "there is no command fly"),
        ("logisticsvln bench merge a b --unfinished --out c", None),
        ("logisticsvln tasks generate --seed 5 --tasks x", "generate: No such option: --tasks"),
        ("python -m tests.load.explorer_ties --world 1", None),  # argparse takes the beginning of an option
        ("python -m tests.load.explorer_ties --world one", "tests.load.explorer_ties: argument --worlds: invalid int"),
        ("python -m tests.load.explorer_ties --wide", "tests.load.explorer_ties: unrecognized arguments: --wide"),
        ("python -m tests.load.nothing", "there is no module tests.load.nothing"),
        ("python -m pytest -m slo", "there is no marker {'slo'}"),
        ("python -m pytest -m browser tests/browser", "there is no tests/browser"),
    ],
)
def test_a_command_that_is_not_there_is_found(line: str, problem: str | None) -> None:
    said = check(tuple(line.split()), whole=True)
    assert (said or "").startswith(problem) if problem else said is None
