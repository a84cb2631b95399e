"""The simple model's classes and colours, in the order of its outputs, and the phrases they go by."""

import json
from pathlib import Path
from typing import NamedTuple, Self

from services.vlm_gateway.embedded.words import Vocabulary as Phrases
from services.vlm_gateway.embedded.words import Wanted


class Vocabulary(NamedTuple):
    """`kinds` in the order of the classifier's outputs; `colours` in the table's order."""

    kinds: tuple[str, ...]
    phrase_of: dict[str, str]
    colours_of: dict[str, tuple[str, ...]]
    colours: tuple[str, ...]
    phrases: Phrases

    @classmethod
    def load(cls, path: Path) -> Self:
        data = json.loads(path.read_text(encoding="utf-8"))
        entries, colours = data["entries"], tuple(data["colours"])
        return cls(
            tuple(e["kind"] for e in entries),
            {e["kind"]: e["phrase"] for e in entries},
            {e["kind"]: tuple(e["colours"]) for e in entries},
            colours,
            Phrases({e["kind"]: (e["phrase"], *e["synonyms"]) for e in entries}, colours),
        )

    def wanted(self, phrase: str) -> Wanted:
        """Raises OutOfVocabulary."""
        return self.phrases.wanted(phrase)
