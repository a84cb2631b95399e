"""What the REST door refuses, before anything is flown, and what it says then."""

from pathlib import Path

import pytest

from mission.ports import ServiceRefused, ServiceUnreachable, UnknownModel
from orchestrator.access import Access
from tests.mission.block_vehicle import BlockWorld
from tests.mission.box_world import BlockVision
from tests.orchestrator.orders import BEHIND, finished, order


@pytest.mark.parametrize("named", [{"backend": "qwen"}, {"settings": {"image_size": 120, "vision_model": "qwen"}}])
def test_a_model_that_there_is_not_is_refused_before_anything_is_flown(door, runs: Path, named: dict) -> None:
    world = BlockWorld(BEHIND)
    unknown = UnknownModel("vlm_gateway: no model 'qwen'; there is embedded")
    vision = BlockVision(world, {"preflight": [unknown]})
    refused = door(world, vision=vision).post("/v1/deliveries", json=order(world, **named))
    assert refused.status_code == 422
    assert refused.json()["error"]["code"] == "unknown_model"
    assert "there is embedded" in refused.json()["error"]["message"]
    assert not list(runs.glob("2*"))
    assert vision.asked == []


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"viewpoint": {"slices": 30}}, "contour has no setting slices; paper has it"),
        ({"viewpoint": {"policy": "contour", "choice": "centre"}}, "contour has no setting choice"),
        ({"viewpoint": {"policy": "sideways"}}, "no search policy sideways; there are paper, random, default, contour"),
        ({"choice": "centre"}, "choice is a setting of a search policy"),
    ],
)
def test_a_setting_that_would_have_no_effect_is_refused(door, runs: Path, settings: dict, said: str) -> None:
    refused = door(BlockWorld(BEHIND)).post("/v1/deliveries", json=order(BlockWorld(BEHIND), settings=settings))
    assert refused.status_code == 422
    assert said in refused.json()["error"]["message"]
    assert not list(runs.glob("2*"))


def test_a_parser_that_there_is_not_is_refused_before_anything_is_flown(door, runs: Path) -> None:
    world = BlockWorld(BEHIND)
    unknown = UnknownModel("vlm_gateway: no model 'qwen'; there is embedded")
    client = door(world, vision=BlockVision(world, {"preflight": [unknown, None]}))
    for name, said in (("qwen", "there is embedded; a parser is 'reader', or a chat model"), ("eyes", "reads no")):
        refused = client.post("/v1/deliveries", json=order(world, settings={"parser_model": name}))
        assert (refused.status_code, refused.json()["error"]["code"]) == (422, "unknown_model")
        assert said in refused.json()["error"]["message"]


def test_two_names_for_the_vision_model_that_differ_are_refused(door, runs: Path) -> None:
    world = BlockWorld(BEHIND)
    named = {"backend": "oracle", "settings": {"image_size": 120, "vision_model": "embedded"}}
    refused = door(world).post("/v1/deliveries", json=order(world, **named))
    assert refused.status_code == 422
    assert "backend oracle and settings.vision_model embedded differ" in refused.json()["error"]["message"]
    assert not list(runs.glob("2*"))


def test_a_model_without_eyes_is_refused_and_a_gateway_that_is_away_is_the_missions_business(door) -> None:
    world = BlockWorld(BEHIND)
    blind = ServiceRefused("vlm_gateway: model 'words' takes no pictures", code="bad_question", status=422)
    client = door(world, vision=BlockVision(world, {"preflight": [blind]}))
    refused = client.post("/v1/deliveries", json=order(world, backend="words"))
    assert (refused.status_code, "takes no pictures" in refused.text) == (422, True)
    away = ServiceUnreachable("vlm_gateway: nobody there")
    client = door(world, vision=BlockVision(world, {"preflight": [away, away]}))
    taken = client.post("/v1/deliveries", json=order(world, backend="words"))
    assert taken.status_code == 202
    result = finished(client, taken.json()["id"]).result
    assert result is not None
    assert result.outcome == "service_unreachable"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"scene": None}, "scene"),
        ({"sample": "no-such-sample"}, "either"),
        ({"scene": None, "sample": "no-such-sample"}, "no sample"),
        ({"request": None}, "request"),
        ({"request": "   "}, "request"),
        ({"settings": {"max_exploration_steps": 0}}, "max_exploration_steps"),
        ({"colour": "red"}, "colour"),
    ],
)
def test_a_delivery_that_cannot_be_flown_is_refused_with_a_reason(door, change: dict, said: str) -> None:
    world = BlockWorld()
    answer = door(world).post("/v1/deliveries", json=order(world) | change)
    assert answer.status_code == 422
    assert said in answer.json()["error"]["message"]


def test_an_unknown_delivery_is_a_typed_404(door) -> None:
    client = door(BlockWorld())
    for path in ("20250101-000000-abcdef", "20250101-000000-abcdef/events", "nonsense"):
        answer = client.get(f"/v1/deliveries/{path}")
        assert answer.status_code == 404
        assert answer.json()["error"]["code"] == "not_found"


def test_a_body_over_the_limit_is_refused(door) -> None:
    answer = door(BlockWorld()).post("/v1/deliveries", content=b"{" + b" " * (5 * 1024 * 1024))
    assert answer.status_code == 413


def test_a_token_guards_deliveries_and_leaves_health_open(door) -> None:
    client = door(BlockWorld(), access=Access("hush", None, lambda: "key", 60))
    assert client.get("/v1/deliveries").status_code == 401
    assert client.get("/healthz").status_code == 200
    assert client.get("/v1/deliveries", headers={"Authorization": "Bearer hush"}).status_code == 200
