"""The subtasks asked of real services: the oracle must be nearly right where only the truth decides."""

import io
from pathlib import Path

import pytest
from rich.console import Console

from command_line.subtask import print_scores
from contracts.geometry import Point3
from contracts.llm_parser import ParseAnswer, ParseQuestion
from contracts.orchestrator import MissionSettings
from evaluation.sim_client import SimClient
from evaluation.subtasks.figures import Subtask
from evaluation.subtasks.run import Examiner, Plan, scored
from evaluation.task_set.shortest import goal_slot
from evaluation.task_set.task import Task
from launcher.processes import FLIGHT_SERVICES, Processes, free_ports, oracle_settings
from mission.clients import AskedVehicle, Services
from mission.ports import ModelUnreachable
from orchestrator import sample_library
from service_kit.settings import process_environment
from tests.evaluation.evaluation_kit import a_task
from tests.mission.block_vehicle import BlockWorld
from tests.mission.box_world import block_ports


def villa() -> Task:
    sample = sample_library.load("villa-teddy-bear")
    slot = goal_slot(sample.scene)
    target = Point3(x=slot.centre[0], y=slot.centre[1], z=slot.centre[2])
    building = sample.scene.building(sample.scene.target)
    return a_task("villa").model_copy(
        update={
            "request": sample.request,
            "scene": sample.scene,
            "floor": slot.floor,
            "floor_height_m": building.floor_height_m,
            "target": target,
            "target_height_m": target.z,
            "object": "brown teddy bear",
            "object_kind": "teddy_bear",
            "object_colour": "brown",
            "building_kind": building.kind,
        }
    )


class Parser:
    """Knows one floor and one object; cannot be reached the second time."""

    def __init__(self) -> None:
        self.asked = 0

    async def parse(self, question: ParseQuestion) -> ParseAnswer:
        self.asked += 1
        if self.asked == 2:
            raise ModelUnreachable("gone")
        return ParseAnswer(floor=3, object="Green flower-pot", model="by hand")


async def test_a_question_at_which_the_model_was_out_of_reach_is_not_scored() -> None:
    ports = block_ports(BlockWorld())
    examiner = Examiner(Plan("embedded"), type(ports)(Parser(), ports.vision, ports.depth), None)
    tasks = [a_task(f"t-{i}") for i in range(3)]
    scores = scored("parse", Plan("embedded"), [await examiner.ask("parse", task) for task in tasks], 1.0)
    assert (scores.rates["both"].k, scores.rates["both"].n) == (2, 2)
    assert scores.model_calls.unreachable == 1
    assert scores.model == "by hand"


async def asked(logs: Path, services: tuple[str, ...], subtasks: dict[Subtask, str]) -> None:
    """The oracle, asked over processes of its own, gets the rate that is named for each subtask right throughout."""
    ports = free_ports(services)
    group = Processes(ports, logs, environment=process_environment(), extra=oracle_settings(ports))
    async with group, Services(group.addresses) as clients:
        plan = Plan("oracle", stops=2, settings=MissionSettings(image_size=400))
        about = AskedVehicle()
        examiner = Examiner(plan, clients.ports(about), SimClient(group.addresses.sim), about)
        for subtask, name in subtasks.items():
            scores = scored(subtask, plan, [await examiner.ask(subtask, villa())], 1.0)
            told = io.StringIO()
            print_scores(Console(file=told, width=120), scores)
            assert scores.questions + scores.skipped >= 1
            assert scores.model_calls.calls == scores.questions
            assert scores.rates[name].k == scores.rates[name].n
            assert name in told.getvalue()


async def test_the_oracle_counts_every_floor_and_chooses_rightly_over_real_services(tmp_path: Path) -> None:
    await asked(tmp_path, FLIGHT_SERVICES, {"floors": "exact", "choice": "agrees"})


@pytest.mark.slow
async def test_the_oracle_finds_everything_over_real_services(tmp_path: Path) -> None:
    await asked(tmp_path, FLIGHT_SERVICES, {"recognition": "recall"})
