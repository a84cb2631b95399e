"""Many episodes at once: each has its own state, and there is a bound on what all of them hold."""

import asyncio
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import httpx
import pytest

from contracts.scene import Scene
from episode_kit.limits import Limits
from services.sim.geometry.scene_mesh import SceneMesh
from services.sim.render.choice import choose_renderer
from services.sim.render.thread import RenderThread
from tests.services.sim.running_sim import BEFORE_THE_POT, Builder, Simulator, error


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
    async with httpx.AsyncClient(timeout=120.0) as http:
        looks = [http.get(f"{url}/observation") for _ in range(4)]
        moves = [http.put(f"{url}/moves/1", json={"path": BEFORE_THE_POT}) for _ in range(4)]
        answers = await asyncio.gather(*looks, *moves)
    assert {a.status_code for a in answers} == {200}
    assert sorted(a.json()["number"] for a in answers[:4]) == [1, 2, 3, 4]
    assert len({a.text for a in answers[4:]}) == 1
    assert sim.http.get(url).json()["moves"] == 1


async def test_many_episodes_at_once_each_keep_their_own_count(sim: Simulator, yard: Scene) -> None:
    async with httpx.AsyncClient(base_url=sim.url, timeout=120.0) as http:

        async def one(z: float) -> tuple[float, dict[str, Any]]:
            started = await http.post("/v1/episodes", json=sim.question(yard))
            i = started.json()["id"]
            await http.put(f"/v1/episodes/{i}/moves/1", json={"path": [{"x": 0.0, "y": -15.0, "z": z}]})
            await http.get(f"/v1/episodes/{i}/observation")
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
    now_s = 100.0
    hasty = launch(Limits(max_episodes=1, lease_s=0.3, kept_scenes=0), clock=lambda: now_s)
    episode = hasty.start(yard)
    assert 0 < episode.expires_in_s <= 0.3
    assert hasty.episodes.scenes == 1
    now_s += 1.0
    give_up = time.monotonic() + 60
    while hasty.episodes.live or hasty.episodes.scenes:
        assert time.monotonic() < give_up, "nothing expired"
        time.sleep(0.02)
    status, code, message = error(hasty.http.get(f"/v1/episodes/{episode.id}"))
    assert (status, code) == (404, "no_such_episode")
    assert "lease" in message
    hasty.start(yard)  # its place is free again


def test_a_lease_is_renewed_by_looks_and_by_the_sign_of_life_but_not_by_watching(
    launch: Callable[..., Simulator], yard: Scene
) -> None:
    now_s = 100.0
    sim = launch(Limits(lease_s=60.0), clock=lambda: now_s)
    held, left = sim.start(yard), sim.start(yard)
    assert held.lease_s == 60.0
    for _ in range(3):
        now_s += 25.0
        assert sim.http.post(f"/v1/episodes/{held.id}/renew").json()["expires_in_s"] == 60.0
        now_s += 25.0
        sim.look(held.id, cameras="front")
        for path in ("", "/trial", "/capabilities"):
            sim.http.get(f"/v1/episodes/{left.id}{path}")
    assert sim.http.get(f"/v1/episodes/{held.id}").status_code == 200
    for call in ("renew", "hold"):
        assert error(sim.http.post(f"/v1/episodes/{left.id}/{call}"))[:2] == (404, "no_such_episode")


def test_a_lease_is_as_long_as_asked_for_within_what_is_granted(launch: Callable[..., Simulator], yard: Scene) -> None:
    sim = launch(Limits(max_lease_s=600.0))
    assert sim.start(yard, lease_s=600.0).lease_s == 600.0
    status, code, message = error(sim.http.post("/v1/episodes", json=sim.question(yard, lease_s=601.0)))
    assert (status, code) == (422, "lease_too_long")
    assert "at most 600" in message


def test_one_owner_has_no_more_than_its_share_and_may_give_all_back(
    launch: Callable[..., Simulator], yard: Scene
) -> None:
    sim = launch(Limits(max_episodes=4, max_per_owner=2))
    for key in ("a", "b"):
        sim.start(yard, owner="greedy", key=key)
    answer = sim.http.post("/v1/episodes", json=sim.question(yard, owner="greedy"))
    assert error(answer)[:2] == (429, "too_many_episodes_of_owner")
    other = sim.start(yard, owner="modest")
    assert sim.http.delete("/v1/episodes", params={"owner": "greedy"}).status_code == 204
    assert sim.episodes.live == 1
    assert sim.http.get(f"/v1/episodes/{other.id}").status_code == 200
    sim.start(yard, owner="greedy", key="a")
    assert error(sim.http.delete("/v1/episodes"))[:2] == (422, "bad_question")


def test_the_same_key_is_the_same_episode_whoever_goes_on_with_it(sim: Simulator, yard: Scene) -> None:
    begun = sim.start(yard, key="delivery", owner="first", lease_s=60.0)
    assert sim.start(yard, key="delivery", owner="second", lease_s=90.0).id == begun.id


def test_a_look_whose_caller_has_left_is_not_drawn(launch: Callable[..., Simulator], yard: Scene) -> None:
    thread = RenderThread(choose_renderer)
    sim = launch(thread=thread)
    episode = sim.start(yard)
    begun, go_on = threading.Event(), threading.Event()

    def hold(_: object) -> None:
        begun.set()
        go_on.wait(120)

    thread.submit(hold)
    assert begun.wait(120)
    for _ in range(3):
        with pytest.raises(httpx.ReadTimeout):
            sim.http.get(f"/v1/episodes/{episode.id}/observation", timeout=0.2)
    time.sleep(0.2)  # the closing of the last one reaches the server
    go_on.set()
    assert sim.look(episode.id).number == 1


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
            assert go_on.wait(120)
        return box_builder(scene)

    busy = launch(builder=slow_for_palaces)
    episode = busy.start(yard)
    with ThreadPoolExecutor(1) as aside:
        waiting = aside.submit(busy.start, yard_with(name="palace"))
        assert begun.wait(120)
        assert busy.http.get("/healthz").status_code == 200
        assert busy.move(episode.id, 1, BEFORE_THE_POT).json()["reached"]
        assert busy.look(episode.id).number == 1
        assert busy.start(yard).status == "flying"
        assert not waiting.done()
        go_on.set()
        assert waiting.result(120).scene == "palace"


def test_more_pictures_than_can_wait_are_refused_and_told_by_readiness(
    launch: Callable[..., Simulator], yard: Scene
) -> None:
    thread = RenderThread(choose_renderer, max_waiting=1)
    jammed = launch(thread=thread)
    episode = jammed.start(yard)
    begun, go_on = threading.Event(), threading.Event()

    def hold(_: object) -> None:
        begun.set()
        go_on.wait(120)

    thread.submit(hold)
    assert begun.wait(120)
    queued = thread.submit(lambda _: None)
    status, code, message = error(jammed.http.get(f"/v1/episodes/{episode.id}/observation"))
    assert (status, code) == (503, "renderer_busy")
    assert "try again" in message
    assert error(jammed.http.get("/readyz"))[:2] == (503, "not_ready")
    go_on.set()
    queued.result(120)
    assert jammed.look(episode.id).number == 1
