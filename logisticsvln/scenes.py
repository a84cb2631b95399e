"""Scene documents: those in files of one's own, and the deliveries that ship with the project."""

from pathlib import Path

from pydantic import ValidationError

from contracts.errors import first_problem
from contracts.orchestrator import Sample
from contracts.scene import Scene
from orchestrator import sample_library

MAX_SCENE_BYTES = 4 * 1024 * 1024


class BadScene(ValueError):
    """A file that is no scene; the message says where and why, and what would be right."""


def read_scene(path: str | Path) -> Scene:
    """The scene document (JSON) in a file; docs/scenes.md has its format. Raises BadScene."""
    path = Path(path)
    try:
        with path.open("rb") as file:
            data = file.read(MAX_SCENE_BYTES + 1)  # the size that a pipe or a device says it has tells nothing
        if len(data) > MAX_SCENE_BYTES:
            raise BadScene(f"{path} is larger than {MAX_SCENE_BYTES} bytes: that is no scene document")
        return Scene.model_validate_json(data.decode("utf-8"))
    except OSError as error:
        raise BadScene(f"{path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise BadScene(f"{path} is not a text file") from None
    except ValidationError as error:
        raise BadScene(f"{path} is not a scene: {first_problem(error)}") from None


def samples() -> list[str]:
    """Names of the deliveries that ship with the project."""
    return sample_library.names()


def sample(name: str) -> Sample:
    """A delivery that ships with the project: its request and its scene. Raises ValueError, naming those there are."""
    return sample_library.load(name)
