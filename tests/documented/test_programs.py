"""Programs and documents inside the documents: Python that compiles and names what is there, scenes, JSON and TOML."""

import ast
import importlib
import json
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

from contracts.scene import Scene
from tests.sources import tree_of_source

ROOT = Path(__file__).parents[2]
DOCUMENTS = sorted({*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")})
BLOCK = re.compile(r"^```(python|json|toml)\n(.*?)^```", re.MULTILINE | re.DOTALL)
ELSEWHERE = {"openai", "requests", "pymavlink"}
"""Libraries of others that a document shows ours beside."""


class Block(NamedTuple):
    document: str
    language: str
    text: str


def blocks() -> Iterator[Block]:
    for document in DOCUMENTS:
        for language, text in BLOCK.findall(document.read_text(encoding="utf-8")):
            yield Block(document.relative_to(ROOT).as_posix(), language, text)


FOUND = list(blocks())


def imported(tree: ast.Module) -> Iterator[tuple[str, list[str]]]:
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module is not None:
            yield node.module, [alias.name for alias in node.names]
        elif isinstance(node, ast.Import):
            yield from ((alias.name, []) for alias in node.names)


@pytest.mark.parametrize("block", FOUND, ids=lambda b: f"{b.document}: {b.language}, {b.text.splitlines()[0][:40]}")
def test_a_block_is_what_it_says_it_is(block: Block) -> None:
    if block.language == "json":
        json.loads(block.text)
    elif block.language == "toml":
        tomllib.loads(block.text)
    else:
        for module, names in imported(tree_of_source(block.text)):
            if module.split(".")[0] in ELSEWHERE:
                continue
            there = importlib.import_module(module)
            assert [name for name in names if not hasattr(there, name)] == []


def test_the_smallest_scene_of_the_documents_is_one() -> None:
    text = next(block.text for block in FOUND if (block.document, block.language) == ("docs/scenes.md", "json"))
    scene = Scene.model_validate_json(text)
    assert scene.goal == "goal"
