"""The one picture of a delivery, drawn from its record."""

from pathlib import Path

import cv2
import numpy as np

from contracts.cameras import shipped_rig
from contracts.orchestrator import DeliveryQuestion, MissionSettings
from mission.clients import Simulated
from orchestrator.delivery import Order, Run
from orchestrator.summary import HEAD, LINE, MARGIN, PANEL
from tests.mission.block import Block, block_scene
from tests.mission.block_vehicle import BlockWorld
from tests.mission.box_world import block_ports


async def head_of(request: str, runs: Path) -> bytes:
    """The pixels of the picture's head, where the request stands."""
    world = BlockWorld(Block(thing=(2.0, 6.2, 10.5), thing_normal=(0.0, 1.0)))
    run = Run(Order(DeliveryQuestion(request=request, scene=block_scene(world.block))), runs)
    await run.fly(Simulated(block_ports(world), world))
    picture = cv2.imread(str(run.record.folder / "summary.png"))
    assert picture is not None
    return picture[:HEAD].tobytes()


async def test_the_request_is_shown_in_the_customer_s_own_letters(tmp_path: Path) -> None:
    own = await head_of("Grüße, 4. Stock", tmp_path)
    assert own == await head_of("Grüße, 4. Stock", tmp_path)
    assert own != await head_of("Gr??e, 4. Stock", tmp_path)
    assert await head_of("Łódź 四楼", tmp_path) != await head_of("??d? ??", tmp_path)


async def test_a_wide_picture_is_shown_whole_and_unstretched(tmp_path: Path) -> None:
    world = BlockWorld(Block())
    settings = MissionSettings(rig=shipped_rig("front-wide"), image_size=160, max_exploration_steps=1)
    asked = DeliveryQuestion(request="floor 4, the green flower pot", scene=block_scene(world.block), settings=settings)
    run = Run(Order(asked), tmp_path)
    await run.fly(Simulated(block_ports(world), world))
    picture = cv2.imread(str(run.record.folder / "summary.png"))
    assert picture is not None
    column = picture[HEAD + 48 : HEAD + 48 + PANEL, MARGIN + PANEL // 2]
    blank = (column == np.array(LINE[::-1])).all(axis=1)
    shown = int((~blank).sum())
    assert abs(shown - PANEL * 720 / 1280) < 4
    assert blank[:10].all()
    assert blank[-10:].all()
