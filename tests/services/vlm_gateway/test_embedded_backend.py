"""The embedded back end's own work: decoding, threads, deadlines, and what its model cannot name. The model is a
small one here; the real one's seeing is tested beside it."""

import asyncio
import threading
from collections.abc import AsyncIterator, Callable, Sequence
from typing import Any

import cv2
import httpx
import numpy as np
import pytest

from contracts.geometry import Box, PointLabel
from service_kit.errors import BadQuestion
from services.vlm_gateway.backends.base import AskedView, BuildingAsk, FloorsAsk, ObjectAsk, Picture
from services.vlm_gateway.backends.embedded import EmbeddedBackend, JpegShot
from services.vlm_gateway.embedded.seen import BoxSeen, FloorsSeen, Found, MarkedPlace, Shot, Sighting
from services.vlm_gateway.embedded.words import OutOfVocabulary
from services.vlm_gateway.errors import ModelOverloaded, ModelTimeout
from tests.cameras import camera_json, square
from tests.conftest import Serve
from tests.services.vlm_gateway.kit import build, find_body, picture, picture_base64, post

BOX = Box(x_min=0.1, y_min=0.1, x_max=0.2, y_max=0.3)


class SmallModel:
    """Counts a picture's brightness as floors, sees what is called "pot" wherever it is bright, and can be held."""

    version = "small-1"
    about: dict[str, object] = {"megabytes": 0.0}

    def __init__(self) -> None:
        self.free = threading.Event()
        self.free.set()

    def out_of_vocabulary(self, phrase: str) -> str | None:
        return None if "pot" in phrase else f"{phrase!r} is no pot"

    def count_floors(self, shot: Shot) -> FloorsSeen:
        self.free.wait(30)
        return FloorsSeen(int(shot.rgb()[..., 0].mean()) // 50, ())

    def building_box(self, shot: Shot) -> BoxSeen | None:
        return BoxSeen(BOX, 0.9) if shot.rgb().mean() > 50 else None

    def find_object(self, views: Sequence[Shot], phrase: str) -> Found:
        if "pot" not in phrase:
            raise OutOfVocabulary(phrase)
        shades = [float(shot.rgb().mean()) / 255 for shot in views]
        return Found(tuple(Sighting(i, BOX, shade) for i, shade in enumerate(shades) if shade > 0.2), claim=0.9)

    def choose_direction(self, shot: Shot, points: Sequence[MarkedPlace]) -> PointLabel:
        return points[-1].label


def shaded(red: int, green: int = 0, blue: int = 0) -> Picture:
    ok, data = cv2.imencode(".png", np.full((16, 16, 3), (blue, green, red), np.uint8))
    assert ok
    return Picture(data.tobytes(), 16, 16)


Make = Callable[..., EmbeddedBackend]


@pytest.fixture
def model() -> SmallModel:
    return SmallModel()


@pytest.fixture
async def make(model: SmallModel) -> AsyncIterator[Make]:
    made: list[EmbeddedBackend] = []

    def one(**settings: Any) -> EmbeddedBackend:
        values: dict[str, Any] = {"alias": "e", "concurrency": 1, "queue": 2, "timeout_s": 20.0} | settings
        made.append(EmbeddedBackend(model, **values))
        return made[-1]

    yield one
    model.free.set()
    for backend in made:
        await backend.close()


async def test_the_model_gets_red_green_and_blue_in_this_order(make: Make) -> None:
    reply = await make().count_floors(FloorsAsk(shaded(250, 100, 0), None))
    assert reply.content is not None
    assert reply.content.count == 5


async def test_no_building_is_an_answer_and_a_building_a_box(make: Make) -> None:
    backend = make()
    dark = await backend.find_building(BuildingAsk(shaded(0), None))
    bright = await backend.find_building(BuildingAsk(shaded(250, 250, 250), None))
    assert dark.content is not None
    assert bright.content is not None
    assert (dark.content.box, bright.content.box) == (None, BOX)


async def test_sightings_name_their_camera_the_surest_first(make: Make) -> None:
    views = (
        AskedView(square(-90), shaded(200, 200, 200)),
        AskedView(square(0), shaded(0)),
        AskedView(square(45), shaded(250, 250, 250)),
    )
    reply = await make().find_object(ObjectAsk("green pot", views))
    assert reply.content is not None
    assert [match.camera for match in reply.content.matches] == ["front-right", "left"]


async def test_a_view_of_the_sky_is_passed_over(make: Make) -> None:
    up = square(0).model_copy(update={"name": "up", "pitch_deg": 90.0})
    views = (AskedView(up, shaded(250, 250, 250)), AskedView(square(45), shaded(250, 250, 250)))
    reply = await make().find_object(ObjectAsk("green pot", views))
    assert reply.content is not None
    assert [match.camera for match in reply.content.matches] == ["front-right"]


async def test_what_is_less_sure_than_a_claim_comes_as_a_candidate_and_is_not_found(make: Make, serve: Serve) -> None:
    url = serve(build({"e": make()}).app)
    answers = []
    for shade in (200, 250):
        body = find_body((0,)) | {
            "views": [{"camera": camera_json(), "image": {"jpeg_base64": picture_base64(shade=shade)}}]
        }
        answers.append(post(url, "/v1/find-object", body).json())
    assert [(a["found"], len(a["matches"]), a["claim_confidence"]) for a in answers] == [
        (False, 1, 0.9),
        (True, 1, 0.9),
    ]


async def test_a_picture_s_key_is_its_file_s(make: Make) -> None:
    keys = [JpegShot(shaded(red)).key for red in (10, 10, 20)]
    assert keys[0] == keys[1]
    assert keys[0] != keys[2]


async def test_a_thing_it_has_no_word_for_is_refused_and_not_denied(make: Make) -> None:
    reply = await make().find_object(ObjectAsk("gramophone", (AskedView(square(0), picture()),)))
    assert (reply.outcome, reply.content) == ("refused", None)
    assert "gramophone" in (reply.text or "")


async def test_data_that_belies_its_header_is_the_caller_s_fault(make: Make) -> None:
    cut = Picture(picture().jpeg[:200], 80, 60)
    with pytest.raises(BadQuestion, match="could not be decoded"):
        await make().count_floors(FloorsAsk(cut, None))


async def test_a_model_that_takes_too_long_is_a_timeout_and_a_full_queue_is_overload(
    make: Make, model: SmallModel
) -> None:
    model.free.clear()
    backend = make(timeout_s=0.3)
    calls = [backend.count_floors(FloorsAsk(shaded(100), None)) for _ in range(5)]
    kinds = [type(result) for result in await asyncio.gather(*calls, return_exceptions=True)]
    assert kinds.count(ModelTimeout) == 3
    assert kinds.count(ModelOverloaded) == 2


async def test_health_is_answered_while_the_model_thinks(make: Make, model: SmallModel, serve: Serve) -> None:
    model.free.clear()
    url = serve(build({"e": make()}).app)
    body = {"image": find_body()["views"][0]["image"]}
    async with httpx.AsyncClient(timeout=60) as client:
        asked = asyncio.create_task(client.post(url + "/v1/floor-count", json=body))
        while (await client.get(url + "/v1/status")).json()["models"]["e"]["running"] == 0:
            assert not asked.done()
        assert (await client.get(url + "/healthz")).status_code == 200
        model.free.set()
        assert (await asked).json()["outcome"] == "answered"
    assert post(url, "/v1/find-object", find_body()).json()["model"] == "embedded-small-1"
