"""What cannot be is refused by the simulator, with what could."""

from typing import Any

import pytest

from contracts.scene import Scene
from tests.services.sim.running_sim import Simulator, error


@pytest.mark.parametrize(
    ("query", "code", "said"),
    [
        ({"cameras": "back"}, "bad_cameras", "'back'; choose from left, front-left, front, front-right, right"),
        ({"cameras": ""}, "bad_cameras", "choose from"),
        ({"cameras": "front,front"}, "bad_cameras", "once"),
        ({"cameras": "front," * 300}, "invalid", "cameras"),
        ({"depth": "maybe"}, "invalid", "depth"),
    ],
)
def test_an_absurd_observation_is_refused(
    sim: Simulator, yard: Scene, query: dict[str, Any], code: str, said: str
) -> None:
    episode = sim.start(yard)
    status, found, message = error(sim.http.get(f"/v1/episodes/{episode.id}/observation", params=query))
    assert (status, found) == (422, code)
    assert said in message


def changed(scene: Scene, path: str, value: object) -> dict[str, Any]:
    """The scene's document with one field, named by its dotted path, set to something else."""
    document: Any = scene.model_dump(mode="json")
    *ways, last = path.split(".")
    here = document
    for way in ways:
        here = here[int(way)] if way.isdigit() else here[way]
    here[last] = value
    return dict(document)


def corners(*places: tuple[float, float]) -> list[dict[str, float]]:
    return [{"x": x, "y": y} for x, y in places]


@pytest.mark.parametrize(
    ("path", "value", "code", "said"),
    [
        ("objects.0.kind", "unicorn", "unknown_object", "flower_pot"),
        ("objects.0.colour", "octarine", "unknown_object", "green"),
        ("objects.0.place.building", "castle", "invalid", "castle"),
        ("objects.0.place.floor", 9, "no_such_window", "floors 1..4"),
        ("objects.0.place.column", 50, "no_such_window", "3 window columns"),
        ("objects.0.place.on", "balcony", "no_such_window", "balcony"),
        ("target", "castle", "invalid", "castle"),
        ("goal", "sword", "invalid", "sword"),
        ("start.position", {"x": 0, "y": 0, "z": 2}, "bad_start", "inside building house"),
        ("start.position", {"x": 0, "y": -15, "z": 0.1}, "bad_start", "touch ground"),
        ("start.position", {"x": 0, "y": -5.1, "z": 2}, "bad_start", "touch house"),
        ("start.position", {"x": 900, "y": 0, "z": 2}, "bad_start", "outside the world"),
        ("ground.half_size_m", 20.0, "bad_scene", "half_size_m"),
        ("buildings.0.footprint", corners((0, 0), (10, 10), (10, 0), (0, 12)), "invalid", "cross or touch"),
        ("buildings.0.footprint", corners((0, 0), (9, 0), (9, 9), (5, 9), (5, 99), (5, 9)), "invalid", "sharper"),
        ("buildings.0.footprint.1.x", 1e308, "invalid", "less than or equal to 10000"),
        ("buildings.0.footprint.1.x", 10**30, "invalid", "less than or equal to 10000"),
        ("buildings.0.floors", 10**30, "invalid", "floors"),
        ("start.yaw", "north", "invalid", "start.yaw"),
        ("buildings", [], "invalid", "buildings"),
        ("weather", "rain", "invalid", "weather"),
    ],
)
def test_a_scene_that_cannot_be_is_refused_with_what_could(
    sim: Simulator, yard: Scene, path: str, value: object, code: str, said: str
) -> None:
    before = sim.episodes.live
    status, found, message = error(sim.http.post("/v1/episodes", json={"scene": changed(yard, path, value)}))
    assert (status, found) == (422, code), message
    assert said in message
    assert sim.episodes.live == before


def test_a_scene_of_too_many_windows_is_refused_before_it_is_built(sim: Simulator, yard: Scene) -> None:
    document = changed(yard, "ground.half_size_m", 500.0)
    house = document["buildings"][0]
    document["buildings"] = [
        house | {"id": f"b{i}", "floors": 60, "footprint": [{"x": s * 490, "y": t * 490} for s, t in corners]}
        for i in range(8)
        for corners in [((-1, -1), (1, -1), (1, 1), (-1, 1))]
    ]
    document |= {"target": "b0", "objects": [], "goal": None}
    status, code, message = error(sim.http.post("/v1/episodes", json={"scene": document}))
    assert (status, code) == (422, "scene_too_large")
    assert "12000" in message


def test_not_a_number_is_refused_in_a_move(sim: Simulator, yard: Scene) -> None:
    episode = sim.start(yard)
    for bad in ("NaN", "Infinity", "1e999"):
        answer = sim.http.put(
            f"/v1/episodes/{episode.id}/moves/1",
            content=f'{{"path": [{{"x": {bad}, "y": 0, "z": 2}}]}}',
            headers={"content-type": "application/json"},
        )
        assert error(answer)[:2] == (422, "invalid"), bad
    assert sim.http.get(f"/v1/episodes/{episode.id}").json()["moves"] == 0


def test_too_many_waypoints_are_refused(sim: Simulator, yard: Scene) -> None:
    episode = sim.start(yard)
    status, code, message = error(sim.move(episode.id, 1, [{"x": 0.0, "y": -15.0, "z": 2.0}] * 65))
    assert (status, code) == (422, "invalid")
    assert "64" in message


def test_a_body_over_the_limit_is_refused_unread(sim: Simulator) -> None:
    answer = sim.http.post("/v1/episodes", content=b" " * (3 * 1024 * 1024))
    assert error(answer)[:2] == (413, "body_too_large")


def test_a_body_that_is_not_json_is_refused(sim: Simulator) -> None:
    assert sim.http.post("/v1/episodes", content=b"{", headers={"content-type": "application/json"}).status_code == 422


@pytest.mark.parametrize(
    ("method", "path", "body"),
    [
        ("GET", "", None),
        ("DELETE", "", None),
        ("GET", "/observation", None),
        ("PUT", "/moves/1", {"path": []}),
        ("POST", "/claim", {}),
        ("POST", "/truth", {}),
    ],
)
def test_an_unknown_episode_is_not_found(sim: Simulator, method: str, path: str, body: Any) -> None:
    answer = sim.http.request(method, f"/v1/episodes/{'0' * 32}{path}", json=body)
    status, code, message = error(answer)
    assert (status, code) == (404, "no_such_episode")
    assert "POST /v1/episodes" in message
