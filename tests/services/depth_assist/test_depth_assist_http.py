"""depth_assist over real HTTP: the real app in a real server; good answers, and typed errors for bad input."""

import json
import math
import socket
import threading
import time
from collections.abc import Iterator
from typing import Any

import httpx
import numpy as np
import pybase64
import pytest
import uvicorn
import zstandard

from contracts.cameras import Camera, pinhole_camera
from contracts.depth_assist import (
    ApproachAnswer,
    ApproachQuestion,
    SafeDistancesAnswer,
    SafeDistanceSettings,
    SafeDistancesQuestion,
    ViewDepth,
    ViewpointAnswer,
    ViewpointQuestion,
)
from contracts.geometry import Box, Pose
from contracts.images import DepthMap, encode_depth
from services.depth_assist.bootstrap import bootstrap
from services.depth_assist.settings import DepthAssistSettings
from tests.cameras import NAMES, square

BODY_LIMIT = 2_000_000


@pytest.fixture(scope="module")
def url() -> Iterator[str]:
    """The service as its bootstrap builds it, in a server of its own on a free port."""
    app = bootstrap(DepthAssistSettings.read({"DEPTH_ASSIST_MAX_BODY_BYTES": str(BODY_LIMIT)}))
    server = uvicorn.Server(uvicorn.Config(app, log_config=None, lifespan="on"))
    listener = socket.create_server(("127.0.0.1", 0))
    thread = threading.Thread(target=server.run, args=([listener],))
    thread.start()
    deadline = time.monotonic() + 20
    while not server.started and time.monotonic() < deadline:
        time.sleep(0.01)
    yield f"http://127.0.0.1:{listener.getsockname()[1]}"
    server.should_exit = True
    thread.join(20)
    listener.close()


@pytest.fixture
def client(url: str) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=url, timeout=20, trust_env=False) as client:
        yield client


def _view(depth_m: np.ndarray, heading: float = 0) -> ViewDepth:
    height, width = depth_m.shape
    camera = pinhole_camera(NAMES[round(heading)], width, height, horizontal_fov_deg=90.0, heading_deg=heading)
    return ViewDepth(camera=camera, depth=encode_depth(depth_m))


def _corner(left_m: float, right_m: float, at: float = 0.5, size: int = 80) -> np.ndarray:
    depth = np.full((size, size), left_m)
    depth[:, round(at * size) :] = right_m
    return depth


def _post(client: httpx.Client, route: str, body: Any) -> httpx.Response:
    content = body if isinstance(body, bytes) else json.dumps(body).encode()
    return client.post(route, content=content, headers={"content-type": "application/json"})


def _error(answer: httpx.Response, status: int, code: str) -> str:
    assert answer.status_code == status, answer.text
    error = answer.json()["error"]
    assert error["code"] == code, error
    assert "Traceback" not in answer.text
    return str(error["message"])


def test_the_service_is_alive_ready_and_described(client: httpx.Client) -> None:
    assert client.get("/healthz").json()["service"] == "depth_assist"
    assert client.get("/readyz").json()["status"] == "ready"
    paths = client.get("/openapi.json").json()["paths"]
    for route in ("/v1/viewpoint", "/v1/safe-distances", "/v1/approach"):
        assert "$ref" in paths[route]["post"]["requestBody"]["content"]["application/json"]["schema"]
    _post(client, "/v1/viewpoint", {})
    assert 'http_requests_total{method="POST",route="/v1/viewpoint",status="422"}' in client.get("/metrics").text


def test_viewpoint_finds_the_edge_and_shows_its_work(client: httpx.Client) -> None:
    open_left = _corner(math.inf, 10.0)
    views = (_view(_corner(10.0, 10.0), -45), _view(open_left, 0), _view(_corner(math.inf, 10.0, 0.75), 45))
    answer = ViewpointAnswer.model_validate_json(
        _post(client, "/v1/viewpoint", ViewpointQuestion(views=views).model_dump_json().encode()).content
    )
    assert (answer.heading_deg, answer.reason) == (45, "split")
    by_heading = {view.heading_deg: view for view in answer.views}
    assert [by_heading[h].best_j for h in (-45, 0, 45)] == [None, 10, 15]
    assert by_heading[0].slice_means_m == pytest.approx((60.0,) * 10 + (10.0,) * 10)
    assert len(by_heading[0].splits) == 19
    split = by_heading[0].splits[9]
    assert (split.j, split.over, split.valid) == (10, 0, True)
    assert (split.difference_m, split.variance_m2) == pytest.approx((50.0, 0.0))


def test_the_buildings_box_crops_the_rows_and_invalid_slices_are_null(client: httpx.Client) -> None:
    depth = _corner(math.inf, 10.0)
    depth[60:] = 4.0  # the street, below the building's box
    depth[:60, :4] = np.nan
    question = ViewpointQuestion(
        views=(_view(depth),), building_box=Box(x_min=0.4, y_min=0.1, x_max=0.6, y_max=0.75), d_max_m=35.0
    )
    answer = _post(client, "/v1/viewpoint", question.model_dump_json().encode()).json()
    assert answer["views"][0]["slice_means_m"][0] is None
    assert answer["views"][0]["slice_means_m"][1] == 60.0
    assert answer["views"][0]["slice_means_m"][19] == pytest.approx(10.0)
    assert (answer["d_max_m"], answer["d_max_next_m"]) == (35.0, 25.0)


def test_without_an_edge_d_max_is_handed_on(client: httpx.Client) -> None:
    question = ViewpointQuestion(views=tuple(_view(np.full((20, 20), 9.0), h) for h in (-90, 0, 90)))
    answer = _post(client, "/v1/viewpoint", question.model_dump_json().encode()).json()
    assert (answer["heading_deg"], answer["reason"], answer["d_max_next_m"]) == (90, "no_split", 35.0)


@pytest.mark.parametrize("policy", ["random", "default"])
def test_the_ablations_answer_by_name_and_repeat_by_seed(client: httpx.Client, policy: str) -> None:
    views = tuple(_view(_corner(math.inf, 10.0), h) for h in (-90, -45, 0, 45, 90))
    body = ViewpointQuestion(views=views, seed=5).model_dump(mode="json") | {"settings": {"policy": policy}}
    first, second = (_post(client, "/v1/viewpoint", body).json() for _ in range(2))
    assert first == second
    assert first["reason"] == policy


def test_safe_distances_of_a_wall_straight_ahead(client: httpx.Client) -> None:
    question = SafeDistancesQuestion(view=_view(np.full((121, 121), 8.0)))
    answer = SafeDistancesAnswer.model_validate_json(
        _post(client, "/v1/safe-distances", question.model_dump_json().encode()).content
    )
    assert [point.label for point in answer.points] == ["a", "b", "c", "d", "e"]
    centre = answer.points[2]
    assert (centre.x, centre.y, centre.bearing_deg, centre.corridor_half_width_m) == (0.5, 0.5, 0.0, 1.85)
    assert centre.distance_m == pytest.approx(6.15, abs=0.01)
    assert centre.nearest_return_m == pytest.approx(8.0)
    bare = question.model_copy(update={"settings": SafeDistanceSettings(variant="bare")})
    answer = SafeDistancesAnswer.model_validate_json(
        _post(client, "/v1/safe-distances", bare.model_dump_json().encode()).content
    )
    assert answer.points[2].distance_m == pytest.approx(8.0)


def test_what_lies_beyond_the_sensors_range_is_no_return(client: httpx.Client) -> None:
    settings = SafeDistanceSettings(variant="bare", l_max_m=50.0, sensor_range_m=20.0)
    question = SafeDistancesQuestion(view=_view(np.full((60, 60), 30.0)), settings=settings)
    centre = _post(client, "/v1/safe-distances", question.model_dump_json().encode()).json()["points"][2]
    assert (centre["distance_m"], centre["nearest_return_m"]) == (20.0, None)  # free as far as the sensor reaches


def test_an_approach_stops_in_front_of_the_wall(client: httpx.Client) -> None:
    question = ApproachQuestion(
        view=_view(np.full((120, 120), 8.0)),
        box=Box(x_min=0.48, y_min=0.48, x_max=0.52, y_max=0.52),
        pose=Pose(x=5.0, y=1.0, z=7.0, yaw=math.pi / 2),
    )
    body = question.model_dump_json().encode()
    answer = ApproachAnswer.model_validate_json(_post(client, "/v1/approach", body).content)
    assert answer.status == "clear"
    assert answer.reached
    assert answer.target is not None
    assert answer.stop is not None
    assert (answer.target.x, answer.target.y, answer.target.z) == pytest.approx((5.0, 9.0, 7.0), abs=0.01)
    assert (answer.stop.x, answer.stop.y, answer.stop.z) == pytest.approx((5.0, 7.5, 7.0), abs=0.01)
    assert answer.facing_yaw == pytest.approx(math.pi / 2, abs=0.01)
    assert answer.path == (answer.stop,)
    no_depth = question.model_copy(update={"view": _view(np.full((50, 50), math.inf))})
    assert _post(client, "/v1/approach", no_depth.model_dump_json().encode()).json()["status"] == "no_depth"


def _viewpoint_body(**depth: Any) -> dict[str, Any]:
    body = ViewpointQuestion(views=(_view(np.full((40, 40), 9.0)),)).model_dump(mode="json")
    view = body["views"][0]
    view["depth"] |= depth
    view["camera"] |= {"width": view["depth"]["width"], "height": view["depth"]["height"]}
    return body


def _packed(data: bytes) -> str:
    return pybase64.b64encode(zstandard.ZstdCompressor(level=1).compress(data)).decode()


@pytest.mark.parametrize(
    ("depth", "says"),
    [
        ({"width": 41}, "41 x 40 needs 3280"),
        ({"zstd_base64": "AAAABBBB"}, "not a zstd frame"),
        ({"zstd_base64": "not base64!!"}, "not valid base64"),
        ({"zstd_base64": _packed(bytes(3200))[:20]}, "depth data"),
        ({"zstd_base64": _packed(bytes(300_000_000))}, "unpacks to 300000000 bytes"),
    ],
    ids=["wrong size", "not zstd", "not base64", "truncated", "bomb"],
)
def test_depth_that_is_not_what_it_says_is_named(client: httpx.Client, depth: dict[str, Any], says: str) -> None:
    message = _error(_post(client, "/v1/viewpoint", _viewpoint_body(**depth)), 422, "bad_depth")
    assert says in message
    assert "the view of camera front" in message


def test_every_route_names_bad_depth(client: httpx.Client) -> None:
    view = _viewpoint_body(width=41)["views"][0]
    good = _viewpoint_body()["views"][0]
    good["camera"]["name"] = "front-right"
    pose, box = {"x": 0, "y": 0, "z": 5, "yaw": 0}, {"x_min": 0.4, "y_min": 0.4, "x_max": 0.6, "y_max": 0.6}
    for body in ({"view": view}, {"view": good, "others": [view]}):
        _error(_post(client, "/v1/safe-distances", body), 422, "bad_depth")
        _error(_post(client, "/v1/approach", body | {"pose": pose, "box": box}), 422, "bad_depth")


def test_too_few_columns_are_named(client: httpx.Client) -> None:
    question = ViewpointQuestion(views=(_view(np.full((40, 16), 9.0)),))
    message = _error(_post(client, "/v1/viewpoint", question.model_dump_json().encode()), 422, "bad_depth")
    assert "16 columns" in message


def test_a_depth_map_too_large_to_be_read_is_refused_before_it_is_unpacked(client: httpx.Client) -> None:
    depth = DepthMap(width=4096, height=4096, metres_per_unit=0.002, zstd_base64=_packed(bytes(2 * 4096 * 4096)))
    question = ViewpointQuestion(views=(ViewDepth(camera=square(size=4096), depth=depth),))
    _error(_post(client, "/v1/viewpoint", question.model_dump_json().encode()), 422, "depth_too_large")


def test_two_views_of_one_camera_are_refused(client: httpx.Client) -> None:
    view = _viewpoint_body()["views"][0]
    message = _error(_post(client, "/v1/viewpoint", {"views": [view, view]}), 422, "duplicate_camera")
    assert "front, front" in message
    _error(_post(client, "/v1/safe-distances", {"view": view, "others": [view]}), 422, "duplicate_camera")


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"views": []}, "views"),
        ({"views": None}, "views"),
        ({"d_max_m": -1}, "d_max_m"),
        ({"d_max_m": math.nan}, "d_max_m"),
        ({"settings": {"delta_m": math.inf}}, "settings.delta_m"),
        ({"settings": {"slices": 3}}, "settings.slices"),
        ({"building_box": {"x_min": 0, "y_min": 0.5, "x_max": 1, "y_max": 1.5}}, "building_box.y_max"),
        ({"building_box": {"x_min": 0, "y_min": 0.5, "x_max": 1, "y_max": 0.5}}, "building_box"),
        ({"colour": "red"}, "colour"),
    ],
)
def test_a_wrong_field_is_named(client: httpx.Client, change: dict[str, Any], field: str) -> None:
    answer = _post(client, "/v1/viewpoint", _viewpoint_body() | change)
    _error(answer, 422, "invalid")
    assert answer.json()["error"]["details"]["problems"][0]["field"] == field


def test_depth_in_another_size_than_the_cameras_pictures_is_refused(client: httpx.Client) -> None:
    body = _viewpoint_body()
    body["views"][0]["camera"]["width"] = 60
    assert "60 x 40 pixels; its depth map has 40 x 40" in _error(_post(client, "/v1/viewpoint", body), 422, "invalid")


def test_views_none_of_which_is_level_are_refused_by_name(client: httpx.Client) -> None:
    body = _viewpoint_body()
    body["views"][0]["camera"]["pitch_deg"] = 60
    for route, asked in (("viewpoint", body), ("safe-distances", {"view": body["views"][0]})):
        assert "front" in _error(_post(client, f"/v1/{route}", asked), 422, "no_level_view")


def test_a_camera_that_looks_up_is_passed_over_where_only_level_views_make_sense(client: httpx.Client) -> None:
    level = _view(_corner(math.inf, 10.0))
    up = ViewDepth(
        camera=level.camera.model_copy(update={"name": "up", "pitch_deg": 90.0}), depth=encode_depth(np.ones((80, 80)))
    )
    alone, both = (
        _post(client, "/v1/viewpoint", ViewpointQuestion(views=views).model_dump_json().encode()).json()
        for views in ((level,), (level, up))
    )
    assert alone == both


def test_the_box_of_the_front_picture_crops_another_lens_at_the_same_heights(client: httpx.Client) -> None:
    # the front camera sees 45 degrees up and down, the other one 26.6: half the picture is its whole picture
    front = _view(np.full((80, 80), 20.0))
    wide = np.full((40, 80), 10.0)
    wide[:10] = 50.0  # above the building's box in both
    side = ViewDepth(
        camera=Camera(name="side", width=80, height=40, fx_px=40, fy_px=40, cx_px=40, cy_px=20, heading_deg=90.0),
        depth=encode_depth(wide),
    )
    question = ViewpointQuestion(views=(front, side), building_box=Box(x_min=0.2, y_min=0.375, x_max=0.8, y_max=1.0))
    answer = _post(client, "/v1/viewpoint", question.model_dump_json().encode()).json()
    means = {view["camera"]: view["slice_means_m"] for view in answer["views"]}
    assert means["side"] == pytest.approx([10.0] * 20)


def test_a_body_over_the_limit_is_refused(client: httpx.Client) -> None:
    _error(_post(client, "/v1/viewpoint", b" " * (BODY_LIMIT + 1)), 413, "body_too_large")


def test_broken_json_and_unknown_routes_are_typed(client: httpx.Client) -> None:
    _error(_post(client, "/v1/viewpoint", b'{"views": ['), 422, "invalid")
    _error(client.get("/v1/nothing"), 404, "not_found")
    _error(client.get("/v1/viewpoint"), 405, "method_not_allowed")


def test_health_answers_while_questions_are_worked_on(url: str) -> None:
    body = SafeDistancesQuestion(view=_view(np.full((800, 800), 6.0))).model_dump_json().encode()
    done = threading.Event()

    def ask() -> None:
        with httpx.Client(base_url=url, timeout=30, trust_env=False) as client:
            for _ in range(5):
                _post(client, "/v1/safe-distances", body)
        done.set()

    asking = threading.Thread(target=ask)
    asking.start()
    with httpx.Client(base_url=url, timeout=30, trust_env=False) as client:
        while not done.is_set():
            assert client.get("/healthz").status_code == 200
    asking.join()


async def test_a_token_is_asked_for_where_one_is_set() -> None:
    transport = httpx.ASGITransport(app=bootstrap(DepthAssistSettings.read({"DEPTH_ASSIST_TOKEN": "secret"})))
    async with httpx.AsyncClient(transport=transport, base_url="http://test") as client:
        body = _viewpoint_body()
        _error(await client.post("/v1/viewpoint", json=body), 401, "unauthorised")
        allowed = await client.post("/v1/viewpoint", json=body, headers={"Authorization": "Bearer secret"})
        assert allowed.status_code == 200


@pytest.mark.parametrize("at", [9_999.0, -10_000.0, 10_000.0])
@pytest.mark.parametrize("yaw", [0.0, 1_000.0, -1_000.0, 1.57])
def test_a_pose_at_the_edge_of_the_world_is_answered_or_refused_with_what_would_be_right(
    client: httpx.Client, at: float, yaw: float
) -> None:
    pose = Pose(x=at, y=at, z=at, yaw=yaw).model_dump()
    wall = _view(np.full((64, 64), 15.0)).model_dump()
    box = {"x_min": 0.4, "y_min": 0.4, "x_max": 0.6, "y_max": 0.6}
    for route, body in (
        ("/v1/approach", {"view": wall, "box": box, "pose": pose}),
        ("/v1/explore", {"views": [wall], "pose": pose}),
    ):
        answer = _post(client, route, body)
        if answer.status_code != 200:
            _error(answer, 422, answer.json()["error"]["code"])
    edge = {"view": wall, "box": box, "pose": {"x": 9_999.0, "y": 0.0, "z": 5.0, "yaw": 0.0}}
    assert "choose an origin near" in _error(_post(client, "/v1/approach", edge), 422, "out_of_the_world")


def test_a_unit_of_depth_that_nothing_measures_is_refused(client: httpx.Client) -> None:
    view = _view(np.full((64, 64), 15.0)).model_dump()
    for unit in (5e-324, 1e-9, 0.0, 1e308):
        wrong = view | {"depth": view["depth"] | {"metres_per_unit": unit}}
        assert "metres_per_unit" in _error(_post(client, "/v1/viewpoint", {"views": [wrong]}), 422, "invalid")
