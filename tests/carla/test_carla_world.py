"""What a drone in CARLA sees, hits and is told by the judge, against our own simulator in the same yard."""

from collections.abc import Iterator
from typing import Any

import httpx
import numpy as np
import pytest

from contracts.cameras import default_rig
from contracts.geometry import Pose
from contracts.images import decode_depth, decode_depth_units, decode_jpeg
from contracts.sim import Episode, Verdict
from contracts.vehicle import MoveResult, Observation
from services.sim.render.choice import choose_renderer
from services.sim.render.views import RenderedViews
from tests.carla.conftest import Launch
from tests.carla.doubles import DoubleProcess
from tests.services.sim.conftest import build_boxes, make_yard
from tests.services.sim.running_sim import BEFORE_THE_POT, error

pytestmark = pytest.mark.carla
RIG = default_rig().scaled_to(160)
WITH_A_PROP = """
map = "yard"

[[props]]
object = "pot"
blueprint = "static.prop.plantpot04"
position = { x = 0.0, y = -10.0, z = 1.0 }
"""


def begun(http: httpx.Client, **more: Any) -> Episode:
    body = {"scene": make_yard().model_dump(mode="json"), "rig": RIG.model_dump(mode="json"), **more}
    answer = http.post("/v1/episodes", json=body)
    assert answer.status_code == 201, answer.text
    return Episode.model_validate_json(answer.content)


def look(http: httpx.Client, episode: Episode, **query: Any) -> Observation:
    answer = http.get(f"/v1/episodes/{episode.id}/observation", params=query)
    assert answer.status_code == 200, answer.text
    return Observation.model_validate_json(answer.content)


def fly(http: httpx.Client, episode: Episode, number: int, path: list[dict[str, float]], **more: Any) -> MoveResult:
    answer = http.put(f"/v1/episodes/{episode.id}/moves/{number}", json={"path": path, **more})
    assert answer.status_code == 200, answer.text
    return MoveResult.model_validate_json(answer.content)


@pytest.fixture
def episode(http: httpx.Client) -> Iterator[Episode]:
    started = begun(http)
    yield started
    http.delete(f"/v1/episodes/{started.id}")


def drawn(pose: Pose) -> list[RenderedViews]:
    renderer = choose_renderer()
    try:
        uploaded = renderer.upload(build_boxes(make_yard()))
        return [renderer.render(uploaded, pose, [camera]) for camera in RIG.cameras]
    finally:
        renderer.close()


def test_pictures_and_depth_are_what_the_renderer_drew_from_there(http: httpx.Client, episode: Episode) -> None:
    fly(http, episode, 1, [{"x": 4.0, "y": -14.0, "z": 6.0}], yaw=1.2)
    seen = look(http, episode)
    for view, expected in zip(seen.views, drawn(seen.pose), strict=True):
        assert view.depth is not None
        # CARLA's step of 0.06 mm is lost in the wire's of 2 mm: unit for unit the same, the sky included
        assert np.array_equal(decode_depth_units(view.depth), expected.depth_units[0]), view.camera.name
        assert np.abs(decode_jpeg(view.image).astype(int) - expected.rgb[0]).mean() < 4.0, view.camera.name


def test_a_look_goes_on_while_the_world_stands_still(http: httpx.Client, episode: Episode) -> None:
    first, second = look(http, episode, cameras="front"), look(http, episode, cameras="front", depth=False)
    assert (first.number, second.number) == (1, 2)
    assert first.views[0].image == second.views[0].image
    assert second.views[0].depth is None


def test_a_wall_stops_the_drone_and_the_move_has_collided(http: httpx.Client, episode: Episode) -> None:
    result = fly(http, episode, 1, [{"x": 0.0, "y": 5.0, "z": 1.5}])
    assert (result.collided, result.reached) == (True, False)
    assert result.pose.y == pytest.approx(-5.0 - 0.35 - 0.02, abs=0.03)
    assert result.vehicle.collided
    assert result.vehicle.health.problems
    home = http.post(f"/v1/episodes/{episode.id}/return")
    assert home.json()["mode"] == "holding"


def test_it_lands_on_what_is_below(http: httpx.Client, episode: Episode) -> None:
    landed = http.post(f"/v1/episodes/{episode.id}/land").json()
    assert (landed["mode"], landed["collided"]) == ("landed", False)
    assert landed["pose"]["z"] == pytest.approx(0.35 + 0.02, abs=0.02)


def test_a_claim_in_front_of_the_right_window_is_delivered(http: httpx.Client, episode: Episode) -> None:
    fly(http, episode, 1, BEFORE_THE_POT)
    look(http, episode)
    verdict = Verdict.model_validate_json(http.post(f"/v1/episodes/{episode.id}/claim").content)
    assert verdict.delivered, verdict
    assert (verdict.line_of_sight, verdict.collided, verdict.steps) == (True, False, 1)


def test_of_a_request_of_the_customers_own_the_window_claimed_is_told(http: httpx.Client) -> None:
    episode = begun(http, own_request=True)
    fly(http, episode, 1, BEFORE_THE_POT)
    window = Verdict.model_validate_json(http.post(f"/v1/episodes/{episode.id}/claim").content).window
    http.delete(f"/v1/episodes/{episode.id}")
    assert window is not None
    assert window.claimed == window.goal
    assert "flower pot" in window.claimed.names


def test_behind_the_corner_the_window_is_not_in_sight(http: httpx.Client, episode: Episode) -> None:
    fly(http, episode, 1, [{"x": 7.0, "y": -15.0, "z": 7.65}, {"x": 7.0, "y": -2.0, "z": 7.65}])
    verdict = Verdict.model_validate_json(http.post(f"/v1/episodes/{episode.id}/claim").content)
    assert not verdict.line_of_sight
    assert not verdict.delivered


def test_a_start_inside_a_wall_is_refused_and_nothing_is_kept(http: httpx.Client) -> None:
    scene = make_yard().model_dump(mode="json")
    scene["start"]["position"] = {"x": 0.0, "y": -5.2, "z": 2.0}
    answer = http.post("/v1/episodes", json={"scene": scene, "rig": RIG.model_dump(mode="json")})
    assert error(answer)[:2] == (422, "bad_start")
    http.delete(f"/v1/episodes/{begun(http).id}")


@pytest.mark.parametrize(
    ("document", "code"),
    [
        ('map = "Atlantis"', "no_such_map"),
        ('map = "yard"\nweather = "Tuesday"', "bad_carla_scene"),
        (
            'map = "yard"\n[[props]]\nblueprint = "static.prop.dragon"\nposition = {x = 0, y = 0, z = 0}',
            "bad_carla_scene",
        ),
    ],
)
def test_what_carla_has_not_is_refused_by_name(
    double: DoubleProcess, launch: Launch, http: httpx.Client, document: str, code: str
) -> None:
    other = launch(double.port, document=document)
    answer = other.post("/v1/episodes", json={"scene": make_yard().model_dump(mode="json")})
    assert error(answer)[:2] == (422, code)


def test_a_prop_stands_where_its_document_says_and_is_taken_away_again(
    double: DoubleProcess, launch: Launch, http: httpx.Client
) -> None:
    with_it = launch(double.port, document=WITH_A_PROP)

    def ahead_m(client: httpx.Client) -> float:
        started = begun(client)
        seen = look(client, started, cameras="front")
        client.delete(f"/v1/episodes/{started.id}")
        assert seen.views[0].depth is not None
        return float(np.nanmin(decode_depth(seen.views[0].depth)[82:88, 76:84]))

    assert ahead_m(with_it) == pytest.approx(5.0 - 0.25, abs=0.05)
    assert ahead_m(http) == pytest.approx(10.0, abs=0.05)
