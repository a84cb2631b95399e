"""An orchestrator with a door, for all tests about its REST surface."""

from collections.abc import Callable, Iterator
from pathlib import Path

import httpx
import pytest

from tests.mission.block_vehicle import BlockWorld
from tests.orchestrator.door import Door


@pytest.fixture
def runs(tmp_path: Path) -> Path:
    return tmp_path / "runs"


@pytest.fixture
def door(runs: Path) -> Iterator[Callable[..., httpx.Client]]:
    """`door(world)` opens an orchestrator, and closes the one that was opened before."""
    opened: list[Door] = []

    def make(world: BlockWorld, **options: object) -> httpx.Client:
        if opened:
            opened.pop().close()
        opened.append(Door(runs, world, **options))
        return opened[-1].client

    yield make
    for one in opened:
        one.close()
