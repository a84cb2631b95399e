"""A drone that an autopilot outside flies: the simulator draws from the poses it is told, and judges there."""

import httpx

from contracts.scene import Scene
from contracts.sim import Episode, PoseJudged, Verdict
from tests.services.sim.running_sim import Simulator, error

START = {"x": 0.0, "y": -15.0, "z": 1.5, "yaw": 1.5708}
BEFORE_THE_POT = {"x": 0.0, "y": -7.0, "z": 7.65, "yaw": 1.5708}
OVER_THE_ROOF = {"x": 0.0, "y": 0.0, "z": 20.0, "yaw": 0.0}


def put(sim: Simulator, episode: Episode, pose: dict[str, float], *, grounded: bool = False) -> httpx.Response:
    return sim.http.put(f"/v1/episodes/{episode.id}/pose", json={"pose": pose, "grounded": grounded})


def judged(sim: Simulator, episode: Episode, pose: dict[str, float], *, grounded: bool = False) -> PoseJudged:
    answer = put(sim, episode, pose, grounded=grounded)
    assert answer.status_code == 200, answer.text
    return PoseJudged.model_validate_json(answer.content)


def claimed(sim: Simulator, episode: Episode) -> Verdict:
    return Verdict.model_validate_json(sim.http.post(f"/v1/episodes/{episode.id}/claim").content)


def test_it_sees_from_where_it_was_put_and_is_judged_there(sim: Simulator, yard: Scene) -> None:
    episode = sim.start(yard)
    before = sim.look(episode.id, cameras="front")
    for pose in ({**START, "z": 7.65}, BEFORE_THE_POT):
        assert judged(sim, episode, pose) == PoseJudged(collided=False, hit=None)
    seen = sim.look(episode.id, cameras="front")
    assert (seen.pose.y, seen.pose.z) == (-7.0, 7.65)
    assert seen.views[0].image != before.views[0].image
    assert claimed(sim, episode).delivered


def test_what_lies_on_the_way_to_a_pose_is_hit_and_stays_hit(sim: Simulator, yard: Scene) -> None:
    episode = sim.start(yard)
    through = judged(sim, episode, {**START, "y": 20.0})
    assert (through.collided, through.hit) == (True, "house")
    back = judged(sim, episode, {**START, "y": 21.0})
    assert (back.collided, back.hit) == (True, None)
    assert claimed(sim, episode).collided


def test_a_drone_that_stands_on_the_ground_has_not_hit_it(sim: Simulator, yard: Scene) -> None:
    episode = sim.start(yard)
    low = {**START, "z": 0.2}
    assert not judged(sim, episode, low, grounded=True).collided
    assert not judged(sim, episode, START, grounded=True).collided
    assert judged(sim, episode, low).hit == "ground"


def test_a_drone_that_hovers_unsteadily_makes_one_stop(sim: Simulator, yard: Scene) -> None:
    episode = sim.start(yard)
    for off in (0.0, 0.1, -0.15, 0.2):
        judged(sim, episode, {**START, "x": off})
        sim.look(episode.id, cameras="front")
    judged(sim, episode, {**START, "x": 2.0})
    sim.look(episode.id, cameras="front")
    assert claimed(sim, episode).steps == 2


def test_a_pose_after_the_claim_is_refused(sim: Simulator, yard: Scene) -> None:
    episode = sim.start(yard)
    claimed(sim, episode)
    status, code, _ = error(put(sim, episode, OVER_THE_ROOF))
    assert (status, code) == (409, "episode_claimed")
