"""A model is asked for by the name that the gateway has for it, wherever it is named."""

import pytest
from pydantic import ValidationError

from contracts.llm_parser import ParseQuestion
from contracts.orchestrator import DeliveryQuestion, MissionSettings
from contracts.vlm_gateway import PreflightQuestion, Question
from evaluation.bench.run_settings import RunSettings
from evaluation.bench.worker import Job

AS_ITS_MAKERS_WRITE = "Qwen/Qwen2.5-VL-7B-Instruct"
RUN = {"tasks": "t", "checksum": "0", "count": 1, "mission": MissionSettings(), "workers": 1, "versions": {}}
NAMED = [
    (DeliveryQuestion, {"sample": "x"}, "backend"),
    (MissionSettings, {}, "vision_model"),
    (MissionSettings, {}, "parser_model"),
    (Question, {}, "model"),
    (PreflightQuestion, {}, "model"),
    (ParseQuestion, {"request": "x"}, "model"),
    (RunSettings, RUN, "backend"),
    (Job, {"folder": "x", "logs": "x", "mission": MissionSettings()}, "backend"),
]


@pytest.mark.parametrize(("message", "rest", "field"), NAMED, ids=lambda v: getattr(v, "__name__", None))
def test_a_name_as_its_makers_write_it_is_taken_and_one_that_is_none_is_not(
    message: type, rest: dict[str, object], field: str
) -> None:
    assert getattr(message(**rest, **{field: AS_ITS_MAKERS_WRITE}), field) == AS_ITS_MAKERS_WRITE
    for wrong in ("so so", "", "../x", "/x", "x" * 129, "a\nb"):
        with pytest.raises(ValidationError):
            message(**rest, **{field: wrong})
