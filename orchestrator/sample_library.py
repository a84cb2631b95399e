"""The deliveries that ship with the project: one JSON file each (contracts.orchestrator.Sample)."""

from functools import cache
from pathlib import Path

from pydantic import ValidationError

from contracts.errors import first_problem
from contracts.orchestrator import Sample

FOLDER = Path(__file__).parent / "samples"


class UnknownSample(ValueError):
    """No such sample; the message lists those there are."""


def names(folder: Path = FOLDER) -> list[str]:
    return sorted(path.stem for path in folder.glob("*.json"))


@cache
def load(name: str, folder: Path = FOLDER) -> Sample:
    """Raises UnknownSample, or ValueError for a file that is not a sample."""
    if name not in names(folder):
        raise UnknownSample(f"there is no sample {name!r}; there are: {', '.join(names(folder)) or 'none'}")
    try:
        return Sample.model_validate_json((folder / f"{name}.json").read_text(encoding="utf-8"))
    except ValidationError as error:
        raise ValueError(f"sample {name}: {first_problem(error)}") from None
