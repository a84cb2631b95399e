"""What `import logisticsvln` gives: the names that are promised, each loaded when it is used."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import logisticsvln
from tests.sources import tree_of_source

SOURCE = Path(logisticsvln.__file__)


def names_for_type_checkers() -> dict[str, str]:
    """The names under `if TYPE_CHECKING`, and the module that each is said to come from."""
    tree = tree_of_source(SOURCE.read_text(encoding="utf-8"))
    block = next(node for node in tree.body if isinstance(node, ast.If))
    return {a.name: str(n.module) for n in block.body if isinstance(n, ast.ImportFrom) for a in n.names}


def test_every_name_that_is_promised_is_there_and_nothing_else() -> None:
    assert sorted(logisticsvln.__all__) == sorted(logisticsvln._WHERE)
    assert dir(logisticsvln) == sorted(logisticsvln.__all__)
    assert all(getattr(logisticsvln, name) is not None for name in logisticsvln.__all__)


def test_type_checkers_are_told_the_same_as_programs() -> None:
    assert names_for_type_checkers() == logisticsvln._WHERE


def test_a_name_that_is_not_there_is_refused_with_those_there_are() -> None:
    with pytest.raises(AttributeError, match=r"no .Drone.; it has .*Client"):
        logisticsvln.Drone  # noqa: B018


def test_a_program_that_only_asks_an_orchestrator_loads_no_model_and_no_evaluation() -> None:
    code = "import sys, logisticsvln; logisticsvln.Client('http://127.0.0.1:1'); print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert not {"cv2", "pyarrow", "fastapi", "dbos", "evaluation", "mission", "orchestrator"} & set(loaded)


def test_a_library_that_is_not_installed_is_named_with_the_way_to_it() -> None:
    code = (
        "import sys; sys.modules['httpx'] = None\n"
        "import logisticsvln\n"
        "try:\n    logisticsvln.Client\n"
        "except ImportError as error:\n    print(error)"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert said == "logisticsvln.Client needs httpx, which is not installed: pip install '.[all]' from the repository\n"
