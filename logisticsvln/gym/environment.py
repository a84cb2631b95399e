"""The environment: an agent flies a delivery by its own decisions, from the request to the stop before the window.

It sees what a mission sees, pictures, depth, the measured pose and the customer's words; the truth of the scene is in
its measures and its reward alone.
"""

from collections.abc import Sequence
from typing import Any, Literal, SupportsFloat

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from contracts.cameras import DEFAULT_RIG, Rig, load_rig
from contracts.images import DEPTH_METRES_PER_UNIT, NO_RETURN, decode_depth_units, decode_jpeg
from contracts.orchestrator import Sample
from contracts.sim import EpisodeQuestion, Flight
from contracts.vehicle import Observation, VehicleState
from evaluation.task_set.task import Task
from logisticsvln.gym.actions import ActionSpace, Strides, actions_of
from logisticsvln.gym.assignments import LETTERS, LONGEST_REQUEST, SAMPLES, assignments_of, chosen_by, goal_of
from logisticsvln.gym.measures import Measures
from logisticsvln.gym.world import World

Reward = Literal["sparse", "progress"]
FARTHEST_M = NO_RETURN * DEPTH_METRES_PER_UNIT
"""What depth is where nothing is within the sensor's reach."""
SUCCESS_REWARD = {"sparse": 1.0, "progress": 10.0}


class LogisticsVlnEnv(gymnasium.Env[dict[str, Any], Any]):
    """`LogisticsVLN-v0`."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 4}

    def __init__(
        self,
        *,
        tasks: str | Sequence[Task | Sample] = SAMPLES,
        action_space: ActionSpace = "discrete",
        rig: str | Rig = DEFAULT_RIG,
        image_size: int = 224,
        max_steps: int = 200,
        reward: Reward = "sparse",
        strides: Strides | None = None,
        flight: Flight | None = None,
        url: str | None = None,
        render_mode: str | None = None,
    ) -> None:
        """Starts a simulator for this process, where no environment has yet.

        Args:
            tasks: `samples`, a shipped task set, a file of tasks, or tasks at hand; an episode draws one of them.
            action_space: `discrete` or `waypoint` (`logisticsvln.gym.actions`).
            rig: The drone's cameras: a shipped rig's name, a file, or a rig whose cameras have pictures of one size.
            image_size: The longer side of a picture, pixels.
            max_steps: Moves after which an episode is truncated, as the simulator counts them.
            reward: `sparse`: 1 for a delivery; `progress`: metres nearer to the window at each step, 10 for a delivery.
            strides: How far the discrete actions go.
            flight: How the drone flies: dynamics, speeds, drift of its pose.
            url: Of a simulator that runs already.
            render_mode: `rgb_array`: `render` gives the picture ahead.

        Raises:
            ValueError: For what there is not; BadTasks, BadRig among them.
            CannotStart: Where the simulator can't be started.
        """
        if reward not in SUCCESS_REWARD:
            raise ValueError(f"reward: there are {' and '.join(SUCCESS_REWARD)}, not {reward!r}")
        if max_steps < 1:
            raise ValueError(f"max_steps: {max_steps} is no step; give 1 or more")
        if not 16 <= image_size <= 4096:
            raise ValueError(f"image_size: {image_size} pixels are none; give 16 to 4096")
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(f"render_mode: there is rgb_array, not {render_mode!r}")
        self.render_mode = render_mode
        self._rig = (load_rig(rig) if isinstance(rig, str) else rig).scaled_to(image_size)
        self._assignments = assignments_of(tasks)
        self._actions = actions_of(action_space, strides or Strides())
        self._max_steps = max_steps
        self._reward: Reward = reward
        self._flight = flight or Flight()
        self.action_space = self._actions.space
        self.observation_space = observation_space(self._rig)
        self._world = World(url)
        self._measures: Measures | None = None
        self._seen: dict[str, Any] = {}
        self._state: VehicleState | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """The drone at the start of a task drawn by the seed, or of what `options` name: `task` (a name of the set, a
        Task or a Sample) or `scene` (or its file), and a `request` of one's own."""
        super().reset(seed=seed)
        drawn = self._assignments[int(self.np_random.integers(len(self._assignments)))]
        chance = int(self.np_random.integers(2**31))
        assignment = chosen_by(options or {}, self._assignments) or drawn
        question = EpisodeQuestion(scene=assignment.scene, flight=self._flight, rig=self._rig, seed=chance)
        begun = self._world.begin(question)
        self._measures = Measures(assignment.name, goal_of(assignment), begun.vehicle)
        self._state = begun.vehicle
        self._seen = self._observed(self._world.observe(), assignment.request)
        return self._last_seen(), self._measures.info()

    def step(self, action: Any) -> tuple[dict[str, Any], SupportsFloat, bool, bool, dict[str, Any]]:
        """One move and a look, or the stop that ends the episode. Raises ValueError for an action that is none,
        RuntimeError before the first `reset` and after the end."""
        measures, state = self._measures, self._state
        if measures is None or state is None or measures.over:
            raise RuntimeError("the episode has ended, or was not begun: call reset()")
        move = self._actions.move(action, state.pose)
        if move is None:
            measures.judged(self._world.claim())
            return self._last_seen(), self._rewarded(0.0), True, False, measures.info()
        done = self._world.move(move)
        self._state = done.vehicle
        nearer_m = measures.moved(done.vehicle)
        self._seen = self._observed(self._world.observe(), self._seen["instruction"])
        truncated = done.vehicle.moves >= self._max_steps and not measures.over
        if truncated:
            measures.out_of_steps()
        return self._last_seen(), self._rewarded(nearer_m), done.vehicle.collided, truncated, measures.info()

    def render(self) -> NDArray[np.uint8] | None:
        """(H, W, 3) uint8: what the drone sees ahead; None without a render mode."""
        if self.render_mode is None or not self._seen:
            return None
        front = self._rig.front or self._rig.cameras[0]
        picture: NDArray[np.uint8] = self._seen["rgb"][self._rig.cameras.index(front)]
        return picture

    def close(self) -> None:
        """Gives drone and simulator back."""
        self._world.close()

    def _last_seen(self) -> dict[str, Any]:
        """A copy, which the agent may keep and change."""
        return {name: seen.copy() if isinstance(seen, np.ndarray) else seen for name, seen in self._seen.items()}

    def _rewarded(self, nearer_m: float) -> float:
        assert self._measures is not None
        won = SUCCESS_REWARD[self._reward] if self._measures.success else 0.0
        return won + (nearer_m if self._reward == "progress" else 0.0)

    def _observed(self, seen: Observation, request: str) -> dict[str, Any]:
        views = {view.camera.name: view for view in seen.views}
        depths = [views[camera.name].depth for camera in self._rig.cameras]
        metres = [decode_depth_units(d).astype(np.float32) * d.metres_per_unit for d in depths if d is not None]
        return {
            "rgb": np.stack([decode_jpeg(views[camera.name].image) for camera in self._rig.cameras]),
            "depth": np.minimum(np.stack(metres), FARTHEST_M, dtype=np.float32),
            "pose": np.array([seen.pose.x, seen.pose.y, seen.pose.z, seen.pose.yaw], np.float64),
            "instruction": request,
        }


def observation_space(rig: Rig) -> spaces.Dict:
    """Views in the order of the rig's cameras; depth in metres along the optical axis, 0 where it is unknown, the
    highest value where nothing is within the sensor's reach. Raises ValueError for pictures of different sizes."""
    sizes = {(camera.height, camera.width) for camera in rig.cameras}
    if len(sizes) > 1:
        raise ValueError(f"rig {rig.name}: its pictures have {len(sizes)} sizes; give all cameras the same one")
    (height, width), views = sizes.pop(), len(rig.cameras)
    bound = np.array([10_000.0, 10_000.0, 10_000.0, 1_000.0])
    return spaces.Dict(
        {
            "rgb": spaces.Box(0, 255, (views, height, width, 3), np.uint8),
            "depth": spaces.Box(0.0, FARTHEST_M, (views, height, width), np.float32),
            "pose": spaces.Box(-bound, bound, dtype=np.float64),
            "instruction": spaces.Text(LONGEST_REQUEST, charset=LETTERS),
        }
    )
