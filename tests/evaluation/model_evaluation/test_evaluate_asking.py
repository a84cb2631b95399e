"""What is made of answers, and of questions that bring none."""

from pathlib import Path

import numpy as np

from contracts.images import encode_jpeg, jpeg_bytes
from contracts.sim import Catalogue
from contracts.vlm_gateway import (
    BuildingBoxAnswer,
    BuildingBoxQuestion,
    FindObjectAnswer,
    FindObjectQuestion,
    FloorCountAnswer,
    FloorCountQuestion,
)
from evaluation.model_evaluation.asking import Asker
from mission.ports import ModelUnreachable
from tests.evaluation.model_evaluation.test_evaluate_scores import CAMERAS, LEFT, case, front, look, thing
from tests.mission.block_vehicle import BlockWorld
from tests.mission.box_world import WHO, BlockVision

PICTURE = jpeg_bytes(encode_jpeg(np.zeros((64, 64, 3), np.uint8)))


class Away(BlockVision):
    """Out of reach at the first question of each kind."""

    async def find_object(self, question: FindObjectQuestion) -> FindObjectAnswer:
        self._away("find_object")
        return FindObjectAnswer(role="recognition", found=False, **WHO)

    async def floor_count(self, question: FloorCountQuestion) -> FloorCountAnswer:
        self._away("floor_count")
        return FloorCountAnswer(role="floors", floors=3, **WHO)

    async def building_box(self, question: BuildingBoxQuestion) -> BuildingBoxAnswer:
        return BuildingBoxAnswer(role="floors", **WHO)

    def _away(self, method: str) -> None:
        self.asked.append(method)
        if self.asked.count(method) == 1:
            raise ModelUnreachable("vlm_gateway: connection refused (model_unreachable)")


async def test_questions_at_which_the_model_was_out_of_reach_are_counted_and_left_out(tmp_path: Path) -> None:
    for camera in CAMERAS:
        (tmp_path / f"{camera.name}.jpg").write_bytes(PICTURE)
    streets = [case(seed, look(thing("mug", "red", LEFT)), fronts=(front(1, 3), front(2, 3))) for seed in (1, 2)]
    answers = await Asker(Away(BlockWorld()), tmp_path, Catalogue(entries=()), "m").ask(streets)
    assert answers.unreachable == 2
    assert [(asked.seed, asked.role) for asked in answers.sought if asked.role == "goal"] == [(2, "goal")]
    assert [(told.seed, told.front) for told in answers.counted] == [(2, 0), (2, 1)], "no street with a gap"
    assert {asked.outcome for asked in answers.sought} == {"answered"}
