"""What every back end promises, asked of every implementation."""

import asyncio
import json
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from contracts.cameras import default_rig
from contracts.geometry import Box
from contracts.vlm_gateway import MarkedPoint
from service_kit.client import ServiceClient
from services.vlm_gateway.backends.base import (
    AskedView,
    Backend,
    BuildingAsk,
    DirectionAsk,
    FloorsAsk,
    ObjectAsk,
    Picture,
    Reply,
    asked_vehicle,
)
from services.vlm_gateway.backends.embedded import EmbeddedBackend
from services.vlm_gateway.backends.oracle import OracleBackend
from services.vlm_gateway.backends.scripted import Script, ScriptedBackend
from services.vlm_gateway.embedded.model import EmbeddedModel
from services.vlm_gateway.model_configs import OracleModelConfig
from tests.cameras import square
from tests.conftest import Serve
from tests.services.vlm_gateway.kit import chat_backend
from tests.services.vlm_gateway.openai_mock import Behaviour, OpenAiMock, says
from tests.services.vlm_gateway.small_sim import SmallSim
from tests.services.vlm_gateway.tiny_networks import write_networks

BOX = {"x_min": 0.1, "y_min": 0.1, "x_max": 0.4, "y_max": 0.5}


def facade() -> Picture:
    """A wall with three rows of dark windows and a green patch, 400 x 400."""
    rgb = np.full((400, 400, 3), (205, 195, 180), np.uint8)
    for top in (40, 170, 300):
        for left in range(30, 390, 90):
            rgb[top : top + 60, left : left + 50] = (60, 70, 90)
    rgb[215:235, 60:80] = (40, 160, 60)
    ok, data = cv2.imencode(".jpg", cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR))
    assert ok
    return Picture(data.tobytes(), 400, 400)


PICTURE = facade()
FLOORS = FloorsAsk(PICTURE, square(size=400))
BUILDING = BuildingAsk(PICTURE, square(size=400))
OBJECT = ObjectAsk("green plate", tuple(AskedView(camera, PICTURE) for camera in default_rig().cameras))
LABELS = ("a", "b", "c")
POINTS = tuple(
    MarkedPoint(label=label, x=x, y=0.5, distance_m=3.0) for label, x in zip(LABELS, (0.2, 0.5, 0.8), strict=True)
)
DIRECTION = DirectionAsk(square(90), PICTURE, POINTS, "find the green flower pot")


def script() -> Script:
    matches = [{"camera": "right", "box": BOX, "confidence": 0.9}, {"camera": "front", "box": BOX, "confidence": 0.2}]
    return Script.model_validate(
        {
            "floor-count": [{"floors": 3}],
            "building-box": [{"box": BOX}],
            "find-object": [{"matches": matches}],
            "choose-direction": [{"label": "b"}],
        }
    )


def by_schema() -> Behaviour:
    """Answers whatever form is asked for, as a model under structured output does."""
    answers = {
        "floor_count": {"floors": 3},
        "building_box": {"bbox": [0.1, 0.1, 0.4, 0.5]},
        "object_search": {
            "found": True,
            "matches": [
                {"view": 2, "bbox": [0.1, 0.1, 0.4, 0.5], "confidence": 0.3},
                {"view": 1, "bbox": [0.1, 0.1, 0.4, 0.5], "confidence": 0.8},
            ],
        },
        "direction": {"label": "b"},
    }

    async def behave(request: Any, body: dict[str, Any]) -> Any:
        form = body["response_format"]["json_schema"]["name"]
        return await says(json.dumps(answers[form]))(request, body)

    return behave


@pytest.fixture(autouse=True)
def about_e1() -> None:
    """The oracle is told whose pictures these are; the others never look."""
    asked_vehicle.set("e1")


@pytest.fixture(params=["embedded", "chat", "oracle", "scripted"])
async def backend(request: pytest.FixtureRequest, serve: Serve, tmp_path: Path) -> AsyncIterator[Backend]:
    made: Backend
    mock: OpenAiMock | None = None
    if request.param == "embedded":
        made = EmbeddedBackend(
            EmbeddedModel(write_networks(tmp_path)), alias="m", concurrency=2, queue=64, timeout_s=60.0
        )
    elif request.param == "chat":
        mock = OpenAiMock().start()
        mock.will(by_schema())
        made = chat_backend(mock, key="sk-secret", server="vllm", queue=64)
    elif request.param == "oracle":
        sim = SmallSim()
        sim.shows(45, share=0.5)
        sim.shows(-45, share=0.7)
        made = OracleBackend(ServiceClient("sim", serve(sim.app)), OracleModelConfig(backend="oracle"))
    else:
        made = ScriptedBackend(script(), repeat=True)
    yield made
    await made.close()
    if mock is not None:
        mock.stop()


def agreed(reply: Reply[Any]) -> Any:
    """The content, after what holds for every reply was checked."""
    assert reply.outcome in ("answered", "unreadable", "refused")
    assert (reply.content is not None) == (reply.outcome == "answered")
    assert reply.attempts >= 1
    return reply.content


async def test_before_take_off_it_says_why_it_cannot_see_a_thing_or_nothing(backend: Backend) -> None:
    assert await backend.preflight(None) is None
    assert await backend.preflight("green plate") is None
    why = await backend.preflight("saxophone")
    assert (why is not None and "saxophone" in why) == (backend.kind == "embedded")


async def test_floors_are_a_bounded_count_with_rows_from_the_top(backend: Backend) -> None:
    floors = agreed(await backend.count_floors(FLOORS))
    assert 0 <= floors.count <= 100
    if floors.rows is not None:
        assert list(floors.rows) == sorted(floors.rows)
        assert len(floors.rows) == floors.count
        assert all(0.0 <= row <= 1.0 for row in floors.rows)


async def test_a_building_is_a_box_or_none(backend: Backend) -> None:
    box = agreed(await backend.find_building(BUILDING)).box
    assert box is None or isinstance(box, Box)


async def test_matches_lie_in_asked_views_and_the_most_confident_comes_first(backend: Backend) -> None:
    matches = agreed(await backend.find_object(OBJECT)).matches
    assert len(matches) <= 25
    assert all(default_rig().camera(match.camera) for match in matches)
    confidences = [match.confidence for match in matches]
    assert confidences == sorted(confidences, reverse=True)


async def test_a_direction_is_one_of_the_points_that_were_offered(backend: Backend) -> None:
    assert agreed(await backend.choose_direction(DIRECTION)).label in LABELS


async def test_many_questions_at_once_are_all_answered(backend: Backend) -> None:
    asked = [backend.count_floors(FLOORS) for _ in range(6)]
    asked += [backend.choose_direction(DIRECTION) for _ in range(6)]  # type: ignore[misc]
    assert all(agreed(reply) is not None for reply in await asyncio.gather(*asked))


async def test_the_same_picture_gets_the_same_answer(backend: Backend) -> None:
    assert await backend.count_floors(FLOORS) == await backend.count_floors(FLOORS)


async def test_it_says_what_it_is_without_secrets_and_in_json(backend: Backend) -> None:
    assert backend.kind in ("embedded", "chat", "oracle", "scripted")
    shown = json.dumps([backend.model, backend.fingerprint, backend.status()])
    assert "sk-secret" not in shown
    assert json.dumps(backend.fingerprint) == json.dumps(backend.fingerprint)


def test_only_answers_that_depend_on_the_question_alone_may_be_cached(tmp_path: Path) -> None:
    assert EmbeddedBackend.cacheable
    assert not OracleBackend.cacheable
    assert not ScriptedBackend.cacheable
