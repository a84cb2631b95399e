"""A run whose flights were kept, flown in the block world: a real mission, without services."""

import shutil
from collections.abc import Sequence
from pathlib import Path

from contracts.orchestrator import Delivery, DeliveryQuestion, DeliveryResult, MissionSettings
from evaluation.bench.episode_keeping import EpisodeKeeping
from evaluation.bench.folder import RunFolder
from evaluation.task_set.task import Task
from mission.mission import Mission
from mission.placement import InTrial, trial_question
from tests.evaluation.evaluation_kit import a_record, a_task, run_settings
from tests.mission.block import Block, block_scene
from tests.mission.block_vehicle import BlockWorld
from tests.mission.box_world import block_ports

REQUEST = "floor 4, the green flower pot"


async def recorded_run(path: Path, names: Sequence[str] = ("t-1", "t-2")) -> Path:
    """A run's folder: one flight, which is delivered, under each of these names."""
    tasks = [a_task(name, floor=4, request=REQUEST) for name in names]
    result = await _flown(path, tasks[0])
    for task in tasks[1:]:
        shutil.copytree(path / "episodes" / tasks[0].id, path / "episodes" / task.id)
    with RunFolder(path, run_settings(tasks), tasks) as folder:
        for task in tasks:
            folder.add(a_record(task, result, folder=f"episodes/{task.id}"), 1.0)
    return path


async def _flown(path: Path, task: Task) -> DeliveryResult:
    world = BlockWorld(Block(thing=(2.0, 6.2, 10.5), thing_normal=(0.0, 1.0)))
    settings = MissionSettings()
    scene = block_scene(world.block)
    folder = path / "episodes" / task.id
    delivery = Delivery(
        id=task.id,
        status="waiting",
        phase="parse",
        request=task.request,
        scene=scene.name,
        created="2026-01-01T00:00:00Z",
        folder=str(folder),
    )
    question = DeliveryQuestion(request=task.request, scene=scene, settings=settings)
    with EpisodeKeeping(folder, delivery, question, trajectory=True) as kept:
        placement = kept.placement(InTrial(world, trial_question(scene, settings)))
        result = await Mission(block_ports(world), placement, settings, kept.log).fly(task.request, task.id)
        kept.conclude(result)
    return result
