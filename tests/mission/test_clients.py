"""What the mission makes of a service that refuses: its model is in trouble, or the question was wrong."""

from collections.abc import AsyncIterator, Callable

import numpy as np
import pytest
from fastapi import FastAPI, Response

from contracts.images import encode_jpeg
from contracts.llm_parser import ParseAnswer, ParseQuestion
from contracts.vlm_gateway import FloorCountQuestion
from mission.clients import Services
from mission.ports import ModelUnreachable, ServiceRefused, ServiceUnreachable, UnknownModel
from service_kit.addresses import Addresses
from service_kit.app import create_app
from service_kit.errors import ServiceError

PICTURE = encode_jpeg(np.zeros((64, 64, 3), np.uint8))
TROUBLE = ["model_unreachable", "model_timeout", "model_overloaded", "model_rejected", "not_recorded"]


def told(code: str) -> ServiceError:
    status = {"unauthorised": 401, "forbidden": 403, "bad_image": 422, "too_many": 429}.get(code, 502)
    return ServiceError("the server said: context too long", code=code, status=status)


def refusing() -> FastAPI:
    """A gateway and a parser that refuse by the code in the model's place."""
    app = create_app("refuses", max_body_bytes=100_000)

    @app.post("/v1/floor-count", response_model=None)
    async def floor_count(question: FloorCountQuestion) -> Response:
        if question.model == "garbled":
            return Response("<html>a proxy's page</html>", media_type="text/html")
        raise told(question.model or "bad_request")

    @app.post("/v1/parse")
    async def parse(question: ParseQuestion) -> ParseAnswer:
        raise told(question.model or "bad_request")

    return app


@pytest.fixture
async def services(serve: Callable[[FastAPI], str]) -> AsyncIterator[Services]:
    url = serve(refusing())
    async with Services(Addresses(url, url, url, url)) as made:
        yield made


@pytest.mark.parametrize("code", TROUBLE)
async def test_a_model_that_did_not_answer_is_unreachable_whatever_the_reason(code: str, services: Services) -> None:
    with pytest.raises(ModelUnreachable, match=rf"vlm_gateway: the server said: context too long \({code}\)"):
        await services.ports().vision.floor_count(FloorCountQuestion(model=code, image=PICTURE))
    with pytest.raises(ModelUnreachable, match=rf"llm_parser: .*\({code}\)"):
        await services.ports().parser.parse(ParseQuestion(request="floor 3", model=code))


async def test_a_key_that_may_not_do_this_is_told_what(services: Services) -> None:
    with pytest.raises(ServiceUnreachable, match=r"refuses our token \(403: the server said: context too long\); set"):
        await services.ports().vision.floor_count(FloorCountQuestion(model="forbidden", image=PICTURE))


@pytest.mark.parametrize("code", ["too_many", "internal"])
async def test_a_service_that_cannot_serve_is_unreachable(code: str, services: Services) -> None:
    with pytest.raises(ServiceUnreachable, match=code):
        await services.ports().vision.floor_count(FloorCountQuestion(model=code, image=PICTURE))


async def test_a_service_that_is_not_ours_is_unreachable(services: Services) -> None:
    with pytest.raises(ServiceUnreachable, match="is that our service"):
        await services.ports().vision.floor_count(FloorCountQuestion(model="garbled", image=PICTURE))


async def test_a_model_that_there_is_not_is_told_apart(services: Services) -> None:
    with pytest.raises(UnknownModel, match="vlm_gateway: the server said"):
        await services.ports().vision.floor_count(FloorCountQuestion(model="unknown_model", image=PICTURE))


@pytest.mark.parametrize("code", ["unauthorised", "forbidden"])
async def test_a_service_that_refuses_our_token_says_which_variable_to_set(code: str, services: Services) -> None:
    with pytest.raises(ServiceUnreachable, match=r"vlm_gateway refuses our token .*set GATEWAY_TOKEN or"):
        await services.ports().vision.floor_count(FloorCountQuestion(model=code, image=PICTURE))
    with pytest.raises(ServiceUnreachable, match=r"llm_parser refuses our token .*set LLM_PARSER_TOKEN or"):
        await services.ports().parser.parse(ParseQuestion(request="floor 3", model=code))


async def test_a_question_that_was_wrong_is_the_services_refusal(services: Services) -> None:
    with pytest.raises(ServiceRefused) as caught:
        await services.ports().vision.floor_count(FloorCountQuestion(model="bad_image", image=PICTURE))
    assert (caught.value.code, caught.value.status) == ("bad_image", 422)
