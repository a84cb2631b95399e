"""A task's scene with the drone flown to any stop: pictures as a mission gets them, and the truth about them."""

import contextlib
from collections.abc import Iterator
from contextlib import contextmanager

from contracts.cameras import Camera, Rig
from contracts.geometry import Point3, Pose
from contracts.scene import Scene
from contracts.scene_layout import wall_height_m
from contracts.sim import TruthQuestion, TruthView
from contracts.vehicle import Move, Observation
from evaluation.sim_client import SimClient, SimulatorFault
from evaluation.subtasks.stops import Stop, reached

_ABOVE_M = 12.0


class Stage:
    """One open scene. Every call raises SimulatorFault."""

    def __init__(self, simulator: SimClient, scene: Scene, rig: Rig) -> None:
        self._simulator = simulator
        self._top_m = max(wall_height_m(building) for building in scene.buildings) + _ABOVE_M
        self._rig = rig
        self.front = (rig.front or rig.cameras[0]).name
        opened = simulator.open(scene, self._rig)
        self.episode = opened.id
        self._pose: Pose = opened.vehicle.pose
        self._moves = 0

    def go(self, stop: Stop) -> bool:
        """Over the roofs to the stop; false where something is in the way."""
        self._moves += 1
        corners = [(self._pose.x, self._pose.y, self._top_m), (stop.x, stop.y, self._top_m), (stop.x, stop.y, stop.z)]
        path = tuple(Point3(x=x, y=y, z=z) for x, y, z in corners)
        self._pose = self._simulator.move(self.episode, self._moves, Move(path=path, yaw=stop.yaw)).pose
        return reached(stop, self._pose)

    def look(self, *names: str, depth: bool = False) -> Observation:
        """With the cameras of these names; all of them without any."""
        return self._simulator.observe(self.episode, [camera.name for camera in self._cameras(names)], depth)

    def truth(self, *names: str) -> tuple[TruthView, ...]:
        """What the views of these cameras really show; of all of them without names."""
        return self._simulator.truth(self.episode, TruthQuestion(cameras=self._cameras(names))).views

    def _cameras(self, names: tuple[str, ...]) -> tuple[Camera, ...]:
        return tuple(self._rig.camera(name) for name in names) if names else self._rig.cameras

    def remaining_m(self, places: tuple[Point3, ...]) -> tuple[float | None, ...]:
        """The shortest way from each place to the goal's window; null where there is none."""
        question = TruthQuestion(candidates=places)
        return self._simulator.truth(self.episode, question).remaining_m


@contextmanager
def staged(simulator: SimClient, scene: Scene, rig: Rig) -> Iterator[Stage]:
    """The scene, given back at the end. Raises SimulatorFault."""
    stage = Stage(simulator, scene, rig)
    try:
        yield stage
    finally:
        with contextlib.suppress(SimulatorFault):
            simulator.close(stage.episode)
