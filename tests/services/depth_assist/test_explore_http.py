"""POST /v1/explore over real HTTP: a search carried by its map alone, and typed errors for maps that are none."""

import math
import socket
import threading
import time
from collections.abc import Iterator

import httpx
import numpy as np
import pybase64
import pytest
import uvicorn
import zstandard

from contracts.cameras import pinhole_camera
from contracts.depth_assist import ExploreAnswer, ExploreQuestion, ViewDepth
from contracts.geometry import Box, Pose
from contracts.images import encode_depth
from navigation import camera
from navigation.explorer import map_codec
from services.depth_assist.bootstrap import bootstrap
from services.depth_assist.settings import DepthAssistSettings
from tests.cameras import NAMES
from tests.navigation.raycast_world import Prism, World, rectangle

HOUSE = World([Prism(rectangle(0.0, 14.0, 16.0, 10.0))])
JSON = {"content-type": "application/json"}
START = Pose(x=0.0, y=0.0, z=8.0, yaw=math.pi / 2)


@pytest.fixture(scope="module")
def client() -> Iterator[httpx.Client]:
    server = uvicorn.Server(uvicorn.Config(bootstrap(DepthAssistSettings.read({})), log_config=None, lifespan="on"))
    listener = socket.create_server(("127.0.0.1", 0))
    thread = threading.Thread(target=server.run, args=([listener],))
    thread.start()
    deadline = time.monotonic() + 20
    while not server.started and time.monotonic() < deadline:
        time.sleep(0.01)
    with httpx.Client(base_url=f"http://127.0.0.1:{listener.getsockname()[1]}", timeout=30, trust_env=False) as client:
        yield client
    server.should_exit = True
    thread.join(20)
    listener.close()


def _question(pose: Pose = START, world: World = HOUSE, **more: object) -> ExploreQuestion:
    seen = world.views(camera.Pose(pose.x, pose.y, pose.z, pose.yaw), camera.pinhole(120, 24, 90.0))
    views = tuple(
        ViewDepth(
            camera=pinhole_camera(NAMES[h], 120, 24, horizontal_fov_deg=90.0, heading_deg=h),
            depth=encode_depth(v.depth_m),
        )
        for h, v in seen.items()
    )
    return ExploreQuestion(views=views, pose=pose, **more)


def _ask(client: httpx.Client, question: ExploreQuestion) -> ExploreAnswer:
    answer = client.post("/v1/explore", content=question.model_dump_json(), headers=JSON)
    assert answer.status_code == 200, answer.text
    return ExploreAnswer.model_validate_json(answer.text)


def _refused(client: httpx.Client, question: ExploreQuestion, code: str) -> str:
    answer = client.post("/v1/explore", content=question.model_dump_json(), headers=JSON)
    assert answer.status_code == 422, answer.text
    assert answer.json()["error"]["code"] == code
    assert "Traceback" not in answer.text
    return str(answer.json()["error"]["message"])


def _packed(data: bytes) -> str:
    return pybase64.b64encode(zstandard.ZstdCompressor().compress(data)).decode()


def test_a_search_goes_all_the_way_round_with_nothing_but_its_map(client: httpx.Client) -> None:
    pose, known, stops = START, None, []
    for _ in range(25):
        answer = _ask(client, _question(pose, map=known))
        known = answer.map
        assert len(known) < 20_000
        if answer.status == "done":
            break
        if answer.stop is not None:
            assert answer.distance_m <= 10.0
            pose = pose.model_copy(update={"x": answer.stop.x, "y": answer.stop.y})
            stops.append(pose)
        pose = pose.model_copy(update={"yaw": answer.yaw})
    assert answer.status == "done"
    assert answer.inspected_share > 0.97
    assert max(p.y for p in stops) > 20.0
    assert len(answer.drawing.inspected) > 80
    assert not answer.drawing.expected


def test_the_same_question_has_the_same_answer(client: httpx.Client) -> None:
    assert _ask(client, _question()) == _ask(client, _question())


def test_the_buildings_box_says_which_wall_ahead_is_meant(client: httpx.Client) -> None:
    two = World([Prism(rectangle(-7.0, 14.0, 9.0, 10.0)), Prism(rectangle(7.0, 12.0, 9.0, 6.0))])
    right = _ask(client, _question(world=two, building_box=Box(x_min=0.6, y_min=0.2, x_max=0.9, y_max=0.8)))
    left = _ask(client, _question(world=two, building_box=Box(x_min=0.1, y_min=0.2, x_max=0.4, y_max=0.8)))
    assert all(x > 0 for x, _ in right.drawing.inspected)
    assert all(x < 0 for x, _ in left.drawing.inspected)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("!!!!", "base64"),
        ("AAAAAAAA", "zstd"),
        (_packed(b"short"), "5 bytes"),
        (_packed(bytes(map_codec.LENGTH)), "no explorer's map"),
        (_packed(bytes(50_000_000)), "50000000 bytes"),
    ],
)
def test_a_map_that_is_none_is_refused_before_it_is_unpacked(client: httpx.Client, text: str, said: str) -> None:
    assert said in _refused(client, _question(map=text), "bad_map")


def test_a_damaged_map_is_refused(client: httpx.Client) -> None:
    packed = bytearray(pybase64.b64decode(_ask(client, _question()).map))
    data = bytearray(zstandard.ZstdDecompressor().decompress(bytes(packed)))
    data[20:28] = np.float64(np.nan).tobytes()
    assert "place" in _refused(client, _question(map=_packed(bytes(data))), "bad_map")
    torn = pybase64.b64encode(bytes(packed[:-10])).decode()
    _refused(client, _question(map=torn), "bad_map")


def test_a_drone_outside_its_map_and_one_without_a_wall_ahead_are_told_so(client: httpx.Client) -> None:
    known = _ask(client, _question()).map
    far = START.model_copy(update={"x": 300.0})
    assert "left the map" in _refused(client, _question(far, map=known), "outside_map")
    assert "no wall" in _refused(client, _question(world=World([])), "no_facade")
