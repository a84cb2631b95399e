"""LogisticsVLN-v0 on a real simulator, in a yard that is built quickly."""

import math
import warnings
from collections.abc import Iterator
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import logisticsvln.gym
from contracts.orchestrator import Sample
from contracts.scene_layout import window_slot
from logisticsvln import Refused, Unreachable
from logisticsvln.gym.actions import DISCRETE, FARTHEST_M, HIGHEST_M
from logisticsvln.gym.environment import LogisticsVlnEnv
from tests.conftest import free_port
from tests.load.processes import service
from tests.services.sim.conftest import make_yard

YARD = Sample(name="yard", title="a yard", difficulty="easy", request="floor 3, the green pot", scene=make_yard())
STOP, FORWARD, TURN_LEFT, UP = (DISCRETE.index(name) for name in ("stop", "forward", "turn_left", "up"))


@pytest.fixture(scope="module")
def sim() -> Iterator[str]:
    with service("services.sim") as running:
        yield running.url


def made(sim: str, **more: Any) -> gymnasium.Env[Any, Any]:
    return gymnasium.make(logisticsvln.gym.ENVIRONMENT, tasks=[YARD], image_size=48, url=sim, **more)


@pytest.fixture
def env(sim: str) -> Iterator[gymnasium.Env[Any, Any]]:
    opened = made(sim)
    yield opened
    opened.close()


@pytest.mark.parametrize("action_space", ["discrete", "waypoint"])
def test_gymnasiums_own_checker_finds_nothing(sim: str, action_space: str) -> None:
    env = made(sim, action_space=action_space)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped, skip_render_check=action_space == "waypoint")
    env.close()


def test_an_agent_sees_pictures_depth_pose_and_the_request(env: gymnasium.Env[Any, Any]) -> None:
    seen, info = env.reset(seed=1)
    assert env.observation_space.contains(seen)
    assert (seen["rgb"].shape, seen["depth"].shape) == ((5, 48, 48, 3), (5, 48, 48))
    assert seen["instruction"] == "floor 3, the green pot"
    assert seen["pose"].tolist() == pytest.approx([0.0, -15.0, 1.5, math.pi / 2])
    assert seen["depth"][2, 20, 24] == pytest.approx(10.0, abs=0.3)  # the house's wall straight ahead
    assert info["steps"] == 0
    assert "success" not in info


def test_the_simulator_counts_the_steps_and_measures_the_way(env: gymnasium.Env[Any, Any]) -> None:
    env.reset(seed=1)
    for action in (FORWARD, TURN_LEFT, UP):
        seen, reward, terminated, truncated, info = env.step(action)
        assert (reward, terminated, truncated) == (0.0, False, False)
    assert seen["pose"].tolist() == pytest.approx([0.0, -13.0, 2.5, math.radians(105)], abs=1e-6)
    assert info["steps"] == 3
    assert info["path_m"] == pytest.approx(3.0)
    assert info["path_horizontal_m"] == pytest.approx(2.0)


def test_a_stop_before_the_window_is_a_delivery_with_its_spl(sim: str) -> None:
    env = made(sim, action_space="waypoint", reward="progress")
    _, begun = env.reset(seed=1)
    slot = window_slot(YARD.scene.building("house"), 0, 3, 1)
    up = (slot.centre[2] - 1.5) / HIGHEST_M
    rewards = []
    for way in ([0, 0, up / 2], [0, 0, up / 2], [0, slot.centre[0] / FARTHEST_M, 0], [8.0 / FARTHEST_M, 0, 0]):
        _, reward, terminated, _, info = env.step(np.array([*way, 0, 0], np.float32))
        rewards.append(reward)
        assert not terminated
    assert sum(rewards) == pytest.approx(begun["navigation_error_m"] - info["navigation_error_m"])
    _, reward, terminated, truncated, info = env.step(np.array([0, 0, 0, 0, 1], np.float32))
    assert (reward, terminated, truncated) == (10.0, True, False)
    assert (info["outcome"], info["success"], info["oracle_success"]) == ("delivered", True, True)
    assert info["spl"] == pytest.approx(info["shortest_m"] / info["path_horizontal_m"])
    assert 0.8 < info["spl"] < 1.0
    assert info["verdict"]["distance_m"] == pytest.approx(info["navigation_error_m"])
    with pytest.raises(RuntimeError, match=r"call reset\(\)"):
        env.unwrapped.step(env.action_space.sample())
    env.close()


def test_a_stop_elsewhere_is_told_as_what_it_is(env: gymnasium.Env[Any, Any]) -> None:
    env.reset(seed=1)
    _, reward, terminated, _, info = env.step(STOP)
    assert (reward, terminated) == (0.0, True)
    assert (info["outcome"], info["success"], info["spl"]) == ("wrong_window", False, 0.0)


def test_a_collision_ends_the_episode_and_is_no_success(sim: str) -> None:
    env = made(sim, action_space="waypoint")
    env.reset(seed=1)
    _, _, terminated, _, info = env.step(np.array([1, 0, 0, 0, 0], np.float32))
    assert (terminated, info["outcome"], info["collided"], info["success"]) == (True, "collision", True, False)
    env.close()


def test_an_episode_is_truncated_after_as_many_moves_as_it_may_have(sim: str) -> None:
    env = made(sim, max_steps=2)
    env.reset(seed=1)
    assert env.step(TURN_LEFT)[3] is False
    _, _, terminated, truncated, info = env.step(TURN_LEFT)
    assert (terminated, truncated) == (False, True)
    assert (info["outcome"], info["success"]) == ("truncated", False)
    env.close()


def test_without_a_goal_nothing_is_called_a_success(env: gymnasium.Env[Any, Any]) -> None:
    scene = make_yard(goal=None)
    seen, info = env.reset(seed=1, options={"scene": scene, "request": "floor 2, the red pot"})
    assert seen["instruction"] == "floor 2, the red pot"
    assert info["navigation_error_m"] is None
    info = env.step(STOP)[4]
    assert (info["outcome"], info["success"], info["spl"]) == ("stopped_not_judged", None, None)


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        ({"task": "field"}, "no task 'field'; there is yard"),
        ({"scene": make_yard()}, "a scene needs a request"),
        ({"request": "floor 3"}, "needs a task or a scene"),
        ({"weather": "rain"}, "there is no 'weather'"),
    ],
)
def test_options_that_say_nothing_are_refused(
    env: gymnasium.Env[Any, Any], options: dict[str, Any], problem: str
) -> None:
    with pytest.raises(ValueError, match=problem):
        env.reset(seed=1, options=options)


@pytest.mark.parametrize(
    ("wrong", "problem"),
    [
        ({"tasks": "nowhere"}, "no task set 'nowhere'"),
        ({"tasks": []}, "there are none"),
        ({"action_space": "joystick"}, "'discrete' and 'waypoint'"),
        ({"reward": "rich"}, "sparse and progress"),
        ({"rig": "nowhere"}, "nowhere"),
        ({"max_steps": 0}, "give 1 or more"),
    ],
)
def test_an_environment_that_cannot_be_is_refused_before_anything_starts(wrong: dict[str, Any], problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        LogisticsVlnEnv(**wrong)


def test_an_action_that_is_none_is_refused_with_those_there_are(env: gymnasium.Env[Any, Any]) -> None:
    env.reset(seed=1)
    with pytest.raises(ValueError, match=r"from 0 to 7 \(stop, forward, .*\), not 8"):
        env.unwrapped.step(8)


def test_nobody_and_a_refusal_are_told_apart(sim: str) -> None:
    gone = LogisticsVlnEnv(tasks=[YARD], image_size=48, url=f"http://127.0.0.1:{free_port()}")
    with pytest.raises(Unreachable, match="can't reach"):
        gone.reset(seed=1)
    gone.close()
    env = LogisticsVlnEnv(tasks=[YARD], image_size=48, url=sim)
    start = YARD.scene.start.model_copy(update={"position": YARD.scene.start.position.model_copy(update={"y": 0.0})})
    with pytest.raises(Refused, match="start inside building house"):
        env.reset(seed=1, options={"scene": YARD.scene.model_copy(update={"start": start}), "request": "floor 1"})
    env.close()


def test_environments_are_stepped_together_and_begin_anew_by_themselves(sim: str) -> None:
    envs = gymnasium.make_vec(
        logisticsvln.gym.ENVIRONMENT, num_envs=3, tasks=[YARD], image_size=48, url=sim, max_steps=2
    )
    seen, _ = envs.reset(seed=1)
    assert seen["rgb"].shape == (3, 5, 48, 48, 3)
    assert seen["instruction"] == ("floor 3, the green pot",) * 3
    envs.step(np.full(3, TURN_LEFT))
    _, _, _, truncated, info = envs.step(np.full(3, TURN_LEFT))
    assert truncated.all()
    assert info["outcome"].tolist() == ["truncated"] * 3
    assert envs.step(np.full(3, TURN_LEFT))[4]["steps"].tolist() == [0, 0, 0]  # Gymnasium's reset comes with this step
    envs.close()


@pytest.mark.slow
def test_environments_in_processes_of_their_own_start_a_simulator_each_and_stop_it() -> None:
    envs = gymnasium.make_vec(
        logisticsvln.gym.ENVIRONMENT, num_envs=2, vectorization_mode="async", tasks=[YARD], image_size=48
    )
    seen, _ = envs.reset(seed=1)
    assert seen["rgb"].shape == (2, 5, 48, 48, 3)
    assert envs.step(np.full(2, UP))[4]["steps"].tolist() == [1, 1]
    envs.close()
