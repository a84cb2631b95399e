"""Whoever names no model is answered by the gateway's roles; the gateway is asked so before the flight."""

from pathlib import Path
from typing import Any

import pytest
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from contracts.vlm_gateway import FindObjectQuestion
from logisticsvln import BadDelivery, LocalServices, OwnVision
from service_kit.addresses import Addresses
from tests.conftest import Serve
from tests.mission.block import Block
from tests.mission.block_vehicle import BlockWorld
from tests.mission.box_world import BlockVision


def count_floors(picture: object) -> int:
    return 3


class Counts:
    """Counts floors, and nothing else."""

    count_floors = staticmethod(count_floors)


@pytest.mark.parametrize(
    ("named", "asked"),
    [
        ({}, None),
        ({"vision": "mine"}, "mine"),
        ({"settings": {"vision_model": "mine"}}, "mine"),
        ({"vision": Counts()}, None),
        ({"vision": OwnVision(Counts(), rest="mine")}, "mine"),
    ],
)
def test_the_gateway_is_asked_before_a_flight_about_the_model_named_or_about_its_roles(
    serve: Serve, tmp_path: Path, named: dict[str, Any], asked: str | None
) -> None:
    heard: list[str | None] = []

    async def preflight(request: Request) -> Response:
        heard.append((await request.json())["model"])
        return JSONResponse({"error": {"code": "no_pictures", "message": "it takes no pictures"}}, 422)

    gateway = serve(Starlette(routes=[Route("/v1/preflight", preflight, methods=["POST"])]))
    with (
        LocalServices(at=Addresses(vlm_gateway=gateway)) as services,
        pytest.raises(BadDelivery, match="it takes no pictures"),
    ):
        services.fly(sample="street-kite", out=tmp_path / "runs", **named)
    assert heard == [asked]


def test_a_backend_and_a_vision_model_that_differ_are_told(tmp_path: Path) -> None:
    with (
        LocalServices(at=Addresses()) as services,
        pytest.raises(BadDelivery, match=r"backend mine and .* theirs differ"),
    ):
        services.fly(sample="street-kite", vision="mine", settings={"vision_model": "theirs"}, out=tmp_path)


@pytest.mark.parametrize("rest", [None, "mine"])
async def test_what_a_model_of_ones_own_does_not_answer_goes_to_the_roles_or_to_the_rest_named(
    rest: str | None,
) -> None:
    gateway = Heard(BlockWorld(Block(thing=(2.0, 6.2, 10.5), thing_normal=(0.0, 1.0))))
    own = OwnVision(Counts(), rest=rest).before(gateway)
    with pytest.raises(Enough):
        await own.find_object(FindObjectQuestion.model_construct(model="counts", object="kite", views=()))
    assert gateway.named == [rest]


class Enough(Exception):
    """What was asked is known."""


class Heard(BlockVision):
    """Notes which model is asked for."""

    named: list[str | None]

    async def find_object(self, question: FindObjectQuestion) -> Any:
        self.named = [question.model]
        raise Enough
