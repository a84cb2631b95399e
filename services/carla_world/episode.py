"""A trial in CARLA: a drone on one of its maps, seen and judged by depth."""

import math

from contracts.geometry import Pose
from contracts.scene import Scene
from contracts.sensor_profiles import IdealDepth
from contracts.sim import EpisodeQuestion, Verdict
from episode_kit.drone import Drone
from episode_kit.episode import About, FlyingEpisode
from episode_kit.judge import judge
from episode_kit.kinematics import Vector, wrapped
from episode_kit.odometry import Odometry
from episode_kit.own_request import claimed_window
from episode_kit.trajectory import KinematicPlanner
from service_kit.errors import BadQuestion
from services.carla_world.client import RELEASE, CarlaClient
from services.carla_world.frames import Origin, carla_place, vector
from services.carla_world.rig import CarlaRig, lenses_of
from services.carla_world.scene_documents import CarlaScene, Prop
from services.carla_world.sight import DepthSight
from services.carla_world.sweep import DepthSweeper
from services.carla_world.things import names_of, things_of


class CarlaEpisode(FlyingEpisode):
    """A drone in CARLA's one world. Blocks; call `close` when done."""

    def __init__(self, episode_id: str, client: CarlaClient, document: CarlaScene, question: EpisodeQuestion) -> None:
        """`question`: as `check` lets it through. Raises BadQuestion for a start that touches something or a map that
        CARLA has not, or Unavailable."""
        scene, flight, frame = question.scene, question.flight, document.frame
        client.enter(document.map, document.weather)
        measured = {prop.object: _put_up(client, prop, frame) for prop in document.props}
        self.rig_in_world = CarlaRig(client, question.rig, frame)
        try:
            start = scene.start
            sweeper = DepthSweeper(self.rig_in_world.probe, flight.radius_m)
            if sweeper.touching(vector(start.position)):
                raise BadQuestion(
                    f"the drone, a sphere of radius {flight.radius_m:g} m, would touch something at its start "
                    f"{vector(start.position)} of scene {scene.name!r}, which lies at {tuple(frame)} on map "
                    f"{document.map}; move start.position or the document's origin",
                    code="bad_start",
                )
        except BaseException:
            self.rig_in_world.close()
            raise
        self._scene: Scene = scene
        self._own_request = question.own_request
        known = {name: middle for name, middle in measured.items() if name is not None}
        self._things = things_of(scene, known)
        self._sight = DepthSight(self.rig_in_world.probe, self._things)
        pose = Pose(x=start.position.x, y=start.position.y, z=start.position.z, yaw=wrapped(start.yaw))
        sensors = question.sensors_flown
        seeds = (scene.seed, flight.drift_seed)
        odometry = Odometry(sensors.pose, flight.drift, seeds, noise_seed=question.seed, start=(pose.x, pose.y))
        drone = Drone(
            KinematicPlanner(sweeper, flight),
            flight,
            pose,
            odometry,
            roof_m=document.roof_m,
            underground_m=document.underground_m,
        )
        about = About("carla", scene.name, "carla", f"CARLA {RELEASE}, map {document.map}", sensors.label)
        super().__init__(episode_id, about, drone, flight, question.rig)

    def close(self) -> None:
        """Takes the cameras out of the world."""
        self.rig_in_world.close()

    def judged(self, target: Vector | None) -> Verdict:
        drone = self.drone
        verdict = judge(self._scene, self._things, self._sight, drone.pose, drone.collided, target, self.steps)
        if not self._own_request:
            return verdict
        window = claimed_window(self._scene, self._things, self._sight, drone.pose, target, names_of)
        return verdict.model_copy(update={"window": window})


def check(question: EpisodeQuestion) -> None:
    """Raises BadQuestion for what only our own simulator does, and for cameras that CARLA has not."""
    problem, sensors = None, question.sensors_flown
    if question.flight.model == "quadrotor":
        problem = "flight.model: a free camera flies kinematically; choose kinematic, or leave it out"
    elif question.faults:
        problem = "faults: only our own simulator makes them; leave them out"
    elif not isinstance(sensors.depth, IdealDepth) or not sensors.picture.ideal:
        problem = f"sensors: {sensors.name} says how our own simulator's cameras err; take perfect"
    if problem is not None:
        raise BadQuestion(f"{problem} (this world is CARLA)", code="not_in_carla")
    lenses_of(question.rig)


def _put_up(client: CarlaClient, prop: Prop, frame: Origin) -> Vector:
    """The middle of a prop that stands there now, in the scene's frame: of its bounding box, which turns with it."""
    foot = vector(prop.position)
    ahead, right, up = client.put_up(prop.blueprint, prop.attributes, carla_place(foot, frame, yaw=prop.yaw))
    c, s = math.cos(prop.yaw), math.sin(prop.yaw)
    return foot[0] + ahead * c + right * s, foot[1] + ahead * s - right * c, foot[2] + up
