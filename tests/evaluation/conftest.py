"""One recorded run for all tests that read flights, and copies of it to be damaged."""

import asyncio
import shutil
from pathlib import Path

import pytest

from tests.evaluation.recorded_run import recorded_run


@pytest.fixture(scope="session")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return asyncio.run(recorded_run(tmp_path_factory.mktemp("export") / "run"))


@pytest.fixture
def own_run(run: Path, tmp_path: Path) -> Path:
    """A copy, to be damaged."""
    return Path(shutil.copytree(run, tmp_path / "run"))
