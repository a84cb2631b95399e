"""The commands of the documents: what stands in their blocks of commands, and what sentences name in backticks."""

import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
DOCUMENTS = sorted({*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "training").rglob("*.md")})
FENCED = re.compile(r"^ *```(\w*)[^\n]*\n(.*?)^ *```", re.MULTILINE | re.DOTALL)
SHELLS = ("", "bash", "sh", "shell", "console")
INLINE = re.compile(r"`((?:logisticsvln|make|\.venv/bin/\w+|python -m|curl) [^`\n]+)`")
PROGRAMS = ("logisticsvln", "make", "python", "curl")
"""Those whose words are held against what there is; `curl` asks our services."""
OTHERS = (".", "cp", "docker", "echo", "kubectl", "pip", "sleep", "uv", "wait", "CarlaUE4.sh")
SEPARATORS = ("&&", "||", "|", ";", "&", ">")


class Documented(NamedTuple):
    """One command of a document, as words, without what stands before it (`VARIABLE=value`, `.venv/bin/`)."""

    document: str
    words: tuple[str, ...]
    whole: bool
    """It stands in a block of commands, and not in a sentence, where one may lack what it needs."""

    @property
    def line(self) -> str:
        return shlex.join(self.words)


def blocks_of(document: Path) -> list[str]:
    """The blocks of a document that are commands, as they stand, with long lines in one."""
    text = re.sub(r"<!--.*?-->", "", document.read_text(encoding="utf-8"), flags=re.DOTALL)
    found = [block.replace("\\\n", " ") for language, block in FENCED.findall(text) if language in SHELLS]
    return [block for block in found if any(_is_command(line.strip()) for line in block.splitlines())]


def _is_command(line: str) -> bool:
    """It begins with a program, whatever variables stand before it."""
    words = re.sub(r"^(\$ )?([A-Z_0-9]+=\S+ +)*", "", line).split()
    return bool(words) and not words[0].endswith("/") and Path(words[0]).name in (*PROGRAMS, *OTHERS)


def commands_of(document: Path) -> Iterator[Documented]:
    """Those of ours that a document has, and its requests to our services."""
    lines = [(line.strip(), True) for block in blocks_of(document) for line in block.splitlines()]
    text = FENCED.sub("", document.read_text(encoding="utf-8"))
    for line, whole in [*lines, *((line, False) for line in INLINE.findall(text))]:
        if _is_command(line):
            for part in _parts(shlex.split(line.removeprefix("$ "), comments=True)):
                while part and re.match(r"[A-Z_0-9]+=", part[0]):
                    part = part[1:]
                if part and Path(part[0]).name in PROGRAMS:
                    yield Documented(named(document), (Path(part[0]).name, *part[1:]), whole)


def _parts(words: list[str]) -> Iterator[list[str]]:
    """A line's commands: what stands between `&&`, `;`, `|`."""
    part: list[str] = []
    for word in words:
        if word in SEPARATORS:
            yield part
            part = []
        else:
            part = [*part, word.rstrip(";")]
    yield part


def named(document: Path) -> str:
    return document.relative_to(ROOT).as_posix()


FOUND = sorted({command for document in DOCUMENTS for command in commands_of(document)})
