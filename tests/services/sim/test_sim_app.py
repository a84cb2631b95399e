"""The simulator over real HTTP, with PyBullet and a renderer, in a street of boxes."""

import asyncio
import json
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import httpx
import pytest

from contracts.images import decode_depth, decode_jpeg
from contracts.scene import Scene
from contracts.sim import Catalogue, CatalogueEntry, Episode, MoveResult, Observation, Truth, Verdict
from services.sim.app import build_app
from services.sim.episodes import Episodes, Limits
from services.sim.geometry.scene_mesh import SceneMesh
from services.sim.render.choice import choose_renderer
from services.sim.render.thread import RenderThread

Builder = Callable[[Scene], SceneMesh]
ROOMY = Limits()
BEFORE_THE_POT = [{"x": 0.0, "y": -15.0, "z": 7.65}, {"x": 0.0, "y": -7.0, "z": 7.65}]
CATALOGUE = Catalogue(
    entries=(
        CatalogueEntry(
            kind="flower_pot",
            category="ornaments",
            phrase="flower pot",
            synonyms=("planter",),
            colours=("green", "red"),
            places=("sill",),
            size_m=(0.5, 0.5, 0.5),
        ),
    )
)


class Simulator:
    """One running simulator and short ways to ask it."""

    def __init__(self, url: str, episodes: Episodes) -> None:
        self.http = httpx.Client(base_url=url, timeout=30.0)
        self.url = url
        self.episodes = episodes

    def start(self, scene: Scene, **more: Any) -> Episode:
        answer = self.http.post("/v1/episodes", json={"scene": scene.model_dump(mode="json"), **more})
        assert answer.status_code == 201, answer.text
        return Episode.model_validate_json(answer.content)

    def move(self, episode: str, number: int, path: list[dict[str, float]], **more: Any) -> httpx.Response:
        return self.http.put(f"/v1/episodes/{episode}/moves/{number}", json={"path": path, **more})

    def look(self, episode: str, **query: Any) -> Observation:
        answer = self.http.get(f"/v1/episodes/{episode}/observation", params=query)
        assert answer.status_code == 200, answer.text
        return Observation.model_validate_json(answer.content)


def error(answer: httpx.Response) -> tuple[int, str, str]:
    body = answer.json()["error"]
    return answer.status_code, body["code"], body["message"]


@pytest.fixture(scope="module")
def launch(serve: Callable[[Any], str], box_builder: Builder) -> Iterator[Callable[..., Simulator]]:
    started: list[Simulator] = []

    def go(
        limits: Limits = ROOMY,
        *,
        truth: bool = True,
        renderer: str = "auto",
        builder: Builder = box_builder,
        thread: RenderThread | None = None,
    ) -> Simulator:
        thread = thread or RenderThread(lambda: choose_renderer(renderer))  # type: ignore[arg-type]
        episodes = Episodes(builder, thread, limits, truth=truth)
        started.append(Simulator(serve(build_app(episodes, thread, CATALOGUE, truth=truth)), episodes))
        return started[-1]

    yield go
    for simulator in started:
        simulator.http.close()


@pytest.fixture(scope="module")
def sim(launch: Callable[..., Simulator]) -> Simulator:
    return launch(Limits(max_episodes=100))


def test_a_delivery_from_start_to_verdict(sim: Simulator, yard: Scene) -> None:
    episode = sim.start(yard)
    assert (episode.status, episode.moves, episode.path_m, episode.collided) == ("flying", 0, 0.0, False)
    assert episode.scene == "yard"
    flown = MoveResult.model_validate_json(sim.move(episode.id, 1, BEFORE_THE_POT).content)
    assert flown.reached
    assert flown.hit is None
    assert flown.path_m == pytest.approx(6.15 + 8.0)
    assert flown.flight_s > 14.15 / 4.0
    assert flown.episode.path_horizontal_m == pytest.approx(8.0)
    verdict = Verdict.model_validate_json(sim.http.post(f"/v1/episodes/{episode.id}/claim", json={}).content)
    assert verdict.delivered
    assert verdict.right_window
    assert verdict.distance_m == pytest.approx(2.0)
    assert verdict.episode.status == "claimed"
    assert sim.http.delete(f"/v1/episodes/{episode.id}").status_code == 204
    assert sim.http.get(f"/v1/episodes/{episode.id}").status_code == 404


def test_the_first_claim_ends_the_episode_and_stays_its_verdict(sim: Simulator, yard: Scene) -> None:
    episode = sim.start(yard)
    claim = f"/v1/episodes/{episode.id}/claim"
    first = sim.http.post(claim, json={})
    assert not first.json()["delivered"]
    better = sim.http.post(claim, json={"target": {"x": 0.0, "y": -5.3, "z": 7.1}})
    assert better.json() == first.json()
    assert error(sim.move(episode.id, 1, BEFORE_THE_POT))[:2] == (409, "episode_claimed")
    assert sim.http.get(f"/v1/episodes/{episode.id}").json()["status"] == "claimed"


def test_a_move_sent_twice_is_flown_once(sim: Simulator, yard: Scene) -> None:
    episode = sim.start(yard)
    first = sim.move(episode.id, 1, BEFORE_THE_POT)
    again = sim.move(episode.id, 1, BEFORE_THE_POT)
    assert again.json() == first.json()
    assert sim.http.get(f"/v1/episodes/{episode.id}").json()["path_m"] == first.json()["path_m"]


@pytest.mark.parametrize("number", [0, 2, 7])
def test_a_gap_in_the_numbers_names_the_expected_one(sim: Simulator, yard: Scene, number: int) -> None:
    episode = sim.start(yard)
    answer = sim.move(episode.id, number, [])
    status, code, message = error(answer)
    assert (status, code) == (409, "move_out_of_order")
    assert "the next move is 1" in message
    assert answer.json()["error"]["details"] == {"expected": 1}


def test_another_move_under_the_last_number_is_refused(sim: Simulator, yard: Scene) -> None:
    episode = sim.start(yard)
    sim.move(episode.id, 1, BEFORE_THE_POT)
    status, code, message = error(sim.move(episode.id, 1, BEFORE_THE_POT[:1]))
    assert (status, code) == (409, "move_differs")
    assert "the next move is 2" in message


def test_a_collision_is_remembered(sim: Simulator, yard: Scene) -> None:
    episode = sim.start(yard)
    hit = sim.move(episode.id, 1, [{"x": 2.5, "y": 0.0, "z": 1.5}]).json()
    assert (hit["reached"], hit["collided"], hit["hit"]) == (False, True, "house")
    assert hit["pose"]["y"] < -5.3
    back = sim.move(episode.id, 2, [{"x": 0.0, "y": -15.0, "z": 1.5}]).json()
    assert (back["reached"], back["collided"], back["hit"]) == (True, False, None)
    assert back["episode"]["collided"]
    sim.move(episode.id, 3, BEFORE_THE_POT)
    verdict = sim.http.post(f"/v1/episodes/{episode.id}/claim").json()
    assert (verdict["right_window"], verdict["delivered"], verdict["collided"]) == (True, False, True)


def test_five_views_with_depth_in_one_call(sim: Simulator, yard: Scene) -> None:
    episode = sim.start(yard)
    seen = sim.look(episode.id, size=96)
    assert [view.heading_deg for view in seen.views] == [-90, -45, 0, 45, 90]
    assert (seen.camera.width, seen.camera.height, seen.camera.focal_px) == (96, 96, 48.0)
    front = seen.views[2]
    assert decode_jpeg(front.image).shape == (96, 96, 3)
    assert front.depth is not None
    # the facade is 10 m ahead of the start, upright to the axis: the same planar depth all along it
    assert decode_depth(front.depth)[40, 30:66] == pytest.approx(10.0, abs=0.02)
    assert sim.look(episode.id, size=96).number == 2


def test_any_subset_of_views_in_the_order_asked_for(sim: Simulator, yard: Scene) -> None:
    episode = sim.start(yard)
    seen = sim.look(episode.id, views="90,+0", size=64, depth="false")
    assert [view.heading_deg for view in seen.views] == [90, 0]
    assert all(view.depth is None for view in seen.views)


def test_the_same_scene_gives_the_same_bytes(sim: Simulator, yard: Scene) -> None:
    first, second = (sim.look(sim.start(yard).id, size=128) for _ in range(2))
    assert first.views == second.views


@pytest.mark.parametrize(
    ("query", "code", "said"),
    [
        ({"views": "7"}, "bad_views", "'7'; choose from -90, -45, 0, 45, 90"),
        ({"views": ""}, "bad_views", "choose from"),
        ({"views": "0,0"}, "bad_views", "once"),
        ({"views": "0," * 30}, "invalid", "views"),
        ({"size": 5000}, "invalid", "size"),
        ({"size": "big"}, "invalid", "size"),
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


def test_episodes_do_not_feel_each_other(sim: Simulator, yard: Scene, yard_with: Callable[..., Scene]) -> None:
    other_yard = yard_with(buildings=yard.buildings[1:], target="shed", objects=(), goal=None)
    here, there = sim.start(yard), sim.start(other_yard)
    through = [{"x": 0.0, "y": 30.0, "z": 1.5}]
    assert sim.move(here.id, 1, through).json()["hit"] == "house"
    assert sim.move(there.id, 1, through).json()["hit"] is None
    twin = sim.start(yard)
    assert sim.http.get(f"/v1/episodes/{twin.id}").json()["pose"]["y"] == -15.0


def test_ids_are_long_and_never_repeat(sim: Simulator, yard: Scene) -> None:
    ids = {sim.start(yard).id for _ in range(5)}
    assert len(ids) == 5
    assert all(len(i) == 32 for i in ids)


async def test_calls_on_one_episode_run_one_after_the_other(sim: Simulator, yard: Scene) -> None:
    episode = sim.start(yard)
    url = f"{sim.url}/v1/episodes/{episode.id}"
    async with httpx.AsyncClient(timeout=30.0) as http:
        looks = [http.get(f"{url}/observation", params={"size": 64}) for _ in range(4)]
        moves = [http.put(f"{url}/moves/1", json={"path": BEFORE_THE_POT}) for _ in range(4)]
        answers = await asyncio.gather(*looks, *moves)
    assert {a.status_code for a in answers} == {200}
    assert sorted(a.json()["number"] for a in answers[:4]) == [1, 2, 3, 4]
    assert len({a.text for a in answers[4:]}) == 1
    assert sim.http.get(url).json()["moves"] == 1


async def test_many_episodes_at_once_each_keep_their_own_count(sim: Simulator, yard: Scene) -> None:
    async with httpx.AsyncClient(base_url=sim.url, timeout=30.0) as http:

        async def one(z: float) -> tuple[float, dict[str, Any]]:
            started = await http.post("/v1/episodes", json={"scene": yard.model_dump(mode="json")})
            i = started.json()["id"]
            await http.put(f"/v1/episodes/{i}/moves/1", json={"path": [{"x": 0.0, "y": -15.0, "z": z}]})
            await http.get(f"/v1/episodes/{i}/observation", params={"size": 64})
            state = (await http.get(f"/v1/episodes/{i}")).json()
            await http.delete(f"/v1/episodes/{i}")
            return z, state

        for z, state in await asyncio.gather(*(one(2.0 + i) for i in range(8))):
            assert state["pose"]["z"] == pytest.approx(z)
            assert state["path_m"] == pytest.approx(z - 1.5)


def test_the_number_of_live_episodes_is_bounded(launch: Callable[..., Simulator], yard: Scene) -> None:
    small = launch(Limits(max_episodes=2))
    first, _ = small.start(yard), small.start(yard)
    answer = small.http.post("/v1/episodes", json={"scene": yard.model_dump(mode="json")})
    status, code, message = error(answer)
    assert (status, code) == (429, "too_many_episodes")
    assert "DELETE" in message
    small.http.delete(f"/v1/episodes/{first.id}")
    small.start(yard)


def test_an_idle_episode_expires_and_frees_what_it_held(launch: Callable[..., Simulator], yard: Scene) -> None:
    hasty = launch(Limits(max_episodes=1, idle_s=0.3, kept_scenes=0))
    episode = hasty.start(yard)
    assert 0 < episode.expires_in_s <= 0.3
    assert hasty.episodes.scenes == 1
    give_up = time.monotonic() + 20
    while hasty.episodes.live or hasty.episodes.scenes:
        assert time.monotonic() < give_up, "nothing expired"
        time.sleep(0.02)
    status, code, message = error(hasty.http.get(f"/v1/episodes/{episode.id}"))
    assert (status, code) == (404, "no_such_episode")
    assert "0.3 s" in message
    hasty.start(yard)  # its place is free again


def test_scenes_nobody_flies_in_are_kept_up_to_a_bound(
    launch: Callable[..., Simulator], yard_with: Callable[..., Scene]
) -> None:
    thrifty = launch(Limits(kept_scenes=2))
    for i in range(4):
        episode = thrifty.start(yard_with(name=f"yard-{i}"))
        thrifty.http.delete(f"/v1/episodes/{episode.id}")
    assert thrifty.episodes.scenes == 2
    assert thrifty.episodes.live == 0


def test_while_a_scene_is_built_others_fly_on_and_health_answers(
    launch: Callable[..., Simulator], box_builder: Builder, yard: Scene, yard_with: Callable[..., Scene]
) -> None:
    begun, go_on = threading.Event(), threading.Event()

    def slow_for_palaces(scene: Scene) -> SceneMesh:
        if scene.name == "palace":
            begun.set()
            assert go_on.wait(30)
        return box_builder(scene)

    busy = launch(builder=slow_for_palaces)
    episode = busy.start(yard)
    with ThreadPoolExecutor(1) as aside:
        waiting = aside.submit(busy.start, yard_with(name="palace"))
        assert begun.wait(30)
        assert busy.http.get("/healthz").status_code == 200
        assert busy.move(episode.id, 1, BEFORE_THE_POT).json()["reached"]
        assert busy.look(episode.id, size=64).number == 1
        assert busy.start(yard).status == "flying"
        assert not waiting.done()
        go_on.set()
        assert waiting.result(30).scene == "palace"


def test_more_pictures_than_can_wait_are_refused_and_told_by_readiness(
    launch: Callable[..., Simulator], yard: Scene
) -> None:
    thread = RenderThread(choose_renderer, max_waiting=1)
    jammed = launch(thread=thread)
    episode = jammed.start(yard)
    begun, go_on = threading.Event(), threading.Event()

    def hold(_: object) -> None:
        begun.set()
        go_on.wait(30)

    thread.submit(hold)
    assert begun.wait(30)
    queued = thread.submit(lambda _: None)
    status, code, message = error(jammed.http.get(f"/v1/episodes/{episode.id}/observation"))
    assert (status, code) == (503, "renderer_busy")
    assert "try again" in message
    assert error(jammed.http.get("/readyz"))[:2] == (503, "not_ready")
    go_on.set()
    queued.result(30)
    assert jammed.look(episode.id, size=64).number == 1


def test_the_truth_names_the_goal_and_the_remaining_way(sim: Simulator, yard: Scene) -> None:
    episode = sim.start(yard)
    sim.move(episode.id, 1, BEFORE_THE_POT)
    question = {"views": [0, 90], "size": 128, "candidates": [{"x": 0.0, "y": -10.5, "z": 7.65}]}
    answer = sim.http.post(f"/v1/episodes/{episode.id}/truth", json=question)
    truth = Truth.model_validate_json(answer.content)
    assert [o.id for o in truth.views[0].objects] == ["pot"]
    assert truth.views[1].objects == ()
    assert truth.remaining_m == pytest.approx((4.0,))


def test_the_truth_after_a_look_is_that_without_one_and_follows_the_drone(sim: Simulator, yard: Scene) -> None:
    question = {"views": [0, 45], "size": 128}

    def told(episode: Episode) -> Truth:
        answer = sim.http.post(f"/v1/episodes/{episode.id}/truth", json=question)
        return Truth.model_validate_json(answer.content)

    looked, blind = sim.start(yard), sim.start(yard)
    sim.look(looked.id, size=128, views="0,90")
    sim.look(looked.id, size=64)
    assert told(looked).views == told(blind).views
    sim.look(looked.id, size=128)
    assert told(looked).views == told(blind).views
    for episode in (looked, blind):
        sim.move(episode.id, 1, BEFORE_THE_POT)
    assert told(looked).views == told(blind).views
    assert [o.id for o in told(looked).views[0].objects] == ["pot"]


def test_a_truth_of_ways_alone_needs_no_views(sim: Simulator, yard: Scene) -> None:
    episode = sim.start(yard)
    question = {"views": [], "candidates": [{"x": 0.0, "y": -10.5, "z": 7.65}]}
    truth = Truth.model_validate_json(sim.http.post(f"/v1/episodes/{episode.id}/truth", json=question).content)
    assert truth.views == ()
    assert truth.remaining_m == pytest.approx((4.0,))


def test_the_truth_is_told_only_where_it_is_switched_on(launch: Callable[..., Simulator], yard: Scene) -> None:
    closed = launch(truth=False)
    episode = closed.start(yard)
    status, code, message = error(closed.http.post(f"/v1/episodes/{episode.id}/truth", json={}))
    assert (status, code) == (404, "truth_off")
    assert "SIM_TRUTH=on" in message
    assert "pot" not in json.dumps(closed.http.get(f"/v1/episodes/{episode.id}").json())


def test_the_catalogue_is_told(sim: Simulator) -> None:
    assert Catalogue.model_validate_json(sim.http.get("/v1/catalogue").content) == CATALOGUE


def test_ready_and_every_answer_say_which_renderer_draws(launch: Callable[..., Simulator], yard: Scene) -> None:
    plain = launch(renderer="tiny")
    ready = plain.http.get("/readyz").json()
    assert ready["about"]["renderer"] == "tiny"
    assert "asked for by the settings" in ready["about"]["renderer_detail"]
    episode = plain.start(yard)
    assert episode.renderer == "tiny"
    assert "asked for by the settings" in episode.renderer_detail
    seen = plain.look(episode.id, size=64, views="0")
    assert seen.renderer == "tiny"
    depth = seen.views[0].depth
    assert depth is not None
    assert decode_depth(depth)[28, 20:44] == pytest.approx(10.0, abs=0.05)


def test_live_episodes_are_counted_in_the_metrics(sim: Simulator, yard: Scene) -> None:
    sim.start(yard)
    assert f"sim_live_episodes {float(sim.episodes.live)}" in sim.http.get("/metrics").text
