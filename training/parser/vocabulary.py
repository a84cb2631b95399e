"""The words by which the reader mends misspelt ones: an English word list, and what customers write."""

import hashlib
import re
import shutil
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path

import zstandard

from services.llm_parser.reader.spelling import Spelling
from training.parser.rows import Row

ENGLISH = "symspellpy/frequency_dictionary_en_82_765.txt"
SHA256 = "68e9dc81c7e73bd7310b57e516ecaea0d8b6387ff71344a57c04174650a407a7"
LIST = "english.txt"
AUTHORS = 4
"""So many have to write a word that the list does not have before it counts as one."""


def take_list(wheels: Path, home: Path) -> None:
    """The word list into `home`. Raises ValueError where it is not the one that the reader was made with."""
    found = wheels / ENGLISH
    if not found.is_file():
        raise ValueError(f"{wheels} holds no {ENGLISH}")
    with found.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    if digest != SHA256:
        raise ValueError(f"{found} has the hash {digest}, not {SHA256}")
    home.mkdir(parents=True, exist_ok=True)
    shutil.copy(found, home / LIST)


def counts(rows: Iterable[Row], english: Iterable[str]) -> dict[str, int]:
    """How often the requests, misspelt ones apart, and the names of their objects have a word of the list; 0 for other
    words that an object's name has, or that `AUTHORS` or more write and that are no sure slip of a word of the list."""
    written: Counter[str] = Counter()
    authors: dict[str, set[str]] = {}
    named: set[str] = set()
    for row in rows:
        text = row.text.lower()
        short = [word.replace("'", "").replace("’", "") for word in re.findall(r"[a-z]+['’][a-z]+", text)]
        said = [] if row.tags & {"typo", "template"} else [text, *short]
        if row.object is not None:
            named.update(re.findall(r"[a-z]+", row.object.lower()))
            said += [row.object.lower(), *(form.lower() for form in row.also_ok)]
        for word in (word for part in said for word in re.findall(r"[a-z]+", part)):
            written[word] += 1
            authors.setdefault(word, set()).add(row.author)
    known = {word: written[word] for word in english}
    spelling = Spelling(known)
    others = [
        word for word, by in authors.items() if len(by) >= AUTHORS and (word in known or not spelling.misspelt(word))
    ]
    return dict.fromkeys([*others, *named], 0) | known


def write(rows: Sequence[Row], home: Path, path: Path) -> None:
    """The file that services.llm_parser.reader.model loads."""
    lines = (home / LIST).read_text(encoding="utf-8-sig").splitlines()
    found = counts(rows, [line.split()[0] for line in lines])
    text = "".join(f"{word} {count}\n" if count else f"{word}\n" for word, count in sorted(found.items()))
    path.write_bytes(zstandard.compress(text.encode(), 19))
