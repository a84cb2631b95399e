"""The oracle: sees what passes its thresholds, knows the way, needs an episode, never learns from the cache."""

import math
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest

from contracts.cameras import pinhole_camera
from contracts.geometry import Pose
from contracts.vlm_gateway import MarkedPoint
from service_kit.client import ServiceClient
from service_kit.errors import BadQuestion, Unavailable
from services.vlm_gateway.backends.base import AskedView, BuildingAsk, DirectionAsk, FloorsAsk, ObjectAsk, asked_vehicle
from services.vlm_gateway.backends.oracle import OracleBackend, end_of, sharp
from services.vlm_gateway.model_configs import OracleModelConfig
from tests.cameras import square
from tests.conftest import Serve
from tests.services.vlm_gateway.kit import (
    HEADINGS,
    build,
    closed_port,
    direction_body,
    find_body,
    picture,
    post,
    sqlite_cache,
)
from tests.services.vlm_gateway.small_sim import BOX, SmallSim

FRONT = square()
VIEWS = tuple(AskedView(square(h), picture()) for h in HEADINGS)
FIND = ObjectAsk("whatever the customer said", VIEWS)
POINTS = tuple(
    MarkedPoint(label=label, x=x, y=0.5, distance_m=4.0)
    for label, x in zip("abcde", (1 / 6, 2 / 6, 0.5, 4 / 6, 5 / 6), strict=True)
)


@pytest.fixture
def sim() -> SmallSim:
    return SmallSim()


@pytest.fixture
async def oracle(serve: Serve, sim: SmallSim) -> AsyncIterator[OracleBackend]:
    backend = OracleBackend(ServiceClient("sim", serve(sim.app)), OracleModelConfig(backend="oracle"))
    yield backend
    await backend.close()


@pytest.fixture(autouse=True)
def about_e1() -> None:
    asked_vehicle.set("e1")


async def test_floors_and_building_are_the_truth(oracle: OracleBackend) -> None:
    floors = (await oracle.count_floors(FloorsAsk(picture(), FRONT))).content
    assert floors is not None
    assert (floors.count, floors.rows) == (3, (0.2, 0.5, 1.0))
    building = (await oracle.find_building(BuildingAsk(picture(), FRONT))).content
    assert building is not None
    assert building.box == BOX


async def test_the_goal_is_seen_in_the_views_that_show_it(oracle: OracleBackend, sim: SmallSim) -> None:
    sim.shows(-45, share=0.5)
    sim.shows(90, share=0.8)
    reply = await oracle.find_object(FIND)
    assert reply.content is not None
    assert [(m.camera, m.confidence) for m in reply.content.matches] == [("right", 0.8), ("front-left", 0.5)]


@pytest.mark.parametrize("hidden", [{"goal": False}, {"share": 0.39}, {"pixels": 79}, {"distance_m": 25.5}])
async def test_what_is_not_the_goal_or_hardly_shows_is_not_seen(
    oracle: OracleBackend, sim: SmallSim, hidden: dict[str, Any]
) -> None:
    sim.shows(0, **hidden)
    reply = await oracle.find_object(FIND)
    assert reply.content is not None
    assert reply.content.matches == ()


def test_it_looks_with_pixels_as_fine_as_ever_whatever_size_the_pictures_have() -> None:
    wide = pinhole_camera("wide", 1280, 720, horizontal_fov_deg=120.0)
    assert sharp(FRONT) is FRONT
    assert sharp(wide) is wide
    assert sharp(square(size=200)) == FRONT
    assert (sharp(square(size=1600)).width, sharp(square(size=1600)).fx_px) == (800, 400.0)


@pytest.mark.parametrize(
    ("heading", "x", "yaw", "end"),
    [
        (0, 0.5, 0.0, (4.0, 0.0)),  # straight ahead, facing east
        (0, 0.5, math.pi / 2, (0.0, 4.0)),  # facing north
        (90, 0.5, math.pi / 2, (4.0, 0.0)),  # to the right of north is east
        (-90, 0.5, math.pi / 2, (-4.0, 0.0)),
        (0, 1.0, math.pi / 2, (4 / math.sqrt(2), 4 / math.sqrt(2))),  # the right edge is 45 degrees to the right
        (45, 0.0, math.pi / 2, (0.0, 4.0)),  # the left edge of the 45 degree view is straight ahead
    ],
)
def test_where_a_marked_point_leads(heading: float, x: float, yaw: float, end: tuple[float, float]) -> None:
    point = MarkedPoint(label="a", x=x, y=0.5, distance_m=4.0)
    there = end_of(point, square(heading), Pose(x=0, y=0, z=7, yaw=yaw))
    assert (there.x, there.y, there.z) == pytest.approx((*end, 7), abs=1e-9)


async def test_the_direction_is_the_one_with_the_shortest_way_left(oracle: OracleBackend, sim: SmallSim) -> None:
    reply = await oracle.choose_direction(DirectionAsk(square(45), picture(), POINTS, "find it"))
    assert reply.content is not None
    assert reply.content.label == "e"  # facing north at the origin, the goal is due east: as far right as one can
    assert len(sim.candidates) == 5
    reply = await oracle.choose_direction(DirectionAsk(square(90), picture(), POINTS, "find it"))
    assert reply.content is not None
    assert reply.content.label == "c"


async def test_no_way_at_all_is_a_refusal_and_no_direction(oracle: OracleBackend, sim: SmallSim) -> None:
    sim.blocked = True
    reply = await oracle.choose_direction(DirectionAsk(FRONT, picture(), POINTS, "find it"))
    assert (reply.outcome, reply.content) == ("refused", None)


async def test_without_a_vehicle_or_with_an_unknown_one_the_question_is_at_fault(oracle: OracleBackend) -> None:
    with pytest.raises(BadQuestion, match="camera"):
        await oracle.count_floors(FloorsAsk(picture(), None))
    asked_vehicle.set(None)
    with pytest.raises(BadQuestion, match="x-oracle-vehicle"):
        await oracle.count_floors(FloorsAsk(picture(), FRONT))
    asked_vehicle.set("e9")
    with pytest.raises(BadQuestion, match="no episode 'e9'"):
        await oracle.count_floors(FloorsAsk(picture(), FRONT))


async def test_a_simulator_that_is_not_there_is_a_service_that_is_unavailable_and_no_model_s_failure() -> None:
    backend = OracleBackend(
        ServiceClient("sim", f"http://127.0.0.1:{closed_port()}"), OracleModelConfig(backend="oracle")
    )
    with pytest.raises(Unavailable, match=r"the oracle's simulator: can't reach"):
        await backend.count_floors(FloorsAsk(picture(), FRONT))
    await backend.close()


def test_over_http_it_is_never_cached_and_works_in_replay_too(serve: Serve, sim: SmallSim, tmp_path: Path) -> None:
    url_of_sim = serve(sim.app)
    for mode in ("on", "replay"):
        oracle = OracleBackend(ServiceClient("sim", url_of_sim), OracleModelConfig(backend="oracle"))
        url = serve(build({"oracle": oracle}, cache=sqlite_cache(tmp_path), mode=mode).app)
        sim.objects = {}
        first = post(url, "/v1/find-object", find_body(), headers={"x-oracle-vehicle": "e1"}).json()
        sim.shows(0)
        second = post(url, "/v1/find-object", find_body(), headers={"x-oracle-vehicle": "e1"}).json()
        assert [(a["found"], a["cache"], a["backend"]) for a in (first, second)] == [
            (False, "off", "oracle"),
            (True, "off", "oracle"),
        ]
    missing = post(url, "/v1/choose-direction", direction_body())
    assert missing.status_code == 422
    assert missing.json()["error"]["code"] == "no_oracle_vehicle"
    assert "x-oracle-vehicle" in missing.json()["error"]["message"]


def test_the_vehicle_named_in_the_body_as_it_used_to_be_is_refused_with_what_is_right(
    serve: Serve, sim: SmallSim
) -> None:
    oracle = OracleBackend(ServiceClient("sim", serve(sim.app)), OracleModelConfig(backend="oracle"))
    url = serve(build({"oracle": oracle}).app)
    for path, body in (("find-object", find_body()), ("choose-direction", direction_body())):
        answer = post(url, f"/v1/{path}", body | {"oracle_episode": "e1"})
        assert answer.status_code == 422
        assert answer.json()["error"]["code"] == "named_in_a_header"
        assert "x-oracle-vehicle" in answer.json()["error"]["message"]
