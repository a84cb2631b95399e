"""A trial in the simulator's own world: its scene, its sensors and faults, and its judge."""

import math

from contracts.geometry import Pose
from contracts.sensor_profiles import FaultKind
from contracts.sim import EpisodeQuestion, PoseJudged, PoseReport, Renderer, Verdict
from contracts.vehicle import VehicleState
from episode_kit.drone import Drone
from episode_kit.episode import About, FlyingEpisode
from episode_kit.judge import judge
from episode_kit.kinematics import Vector, wrapped
from episode_kit.odometry import Odometry
from episode_kit.own_request import claimed_window
from episode_kit.trajectory import KinematicPlanner, Planner
from service_kit.errors import Conflict
from services.sim.catalogue.registry import names_of
from services.sim.dynamic_flight import Pilot
from services.sim.scenes import ReadyScene, check_start
from services.sim.traffic import Traffic
from services.sim.world import GROUND, World

SAME_STOP_M, SAME_STOP_RAD = 0.5, math.radians(10.0)
"""So far an autopilot outside lets the drone wander at a stop."""


class LiveEpisode(FlyingEpisode):
    """A drone in a world of its own. Call `close` when done."""

    def __init__(
        self, episode_id: str, ready: ReadyScene, question: EpisodeQuestion, renderer: Renderer, renderer_detail: str
    ) -> None:
        """Raises BadQuestion for a start that is not in the open air."""
        self.ready = ready
        self.sensors = question.sensors_flown
        self.faults = question.faults
        self._flown_outside = False
        self._own_request = question.own_request
        self.seeds = (ready.scene.seed, question.seed)
        flight = question.flight
        self._world = World(ready.blueprint, flight.radius_m)
        try:
            check_start(ready, self._world)
        except BaseException:
            self._world.close()
            raise
        start = ready.scene.start
        pose = Pose(x=start.position.x, y=start.position.y, z=start.position.z, yaw=wrapped(start.yaw))
        odometry = Odometry(
            self.sensors.pose,
            flight.drift,
            (ready.scene.seed, flight.drift_seed),
            noise_seed=question.seed,
            start=(pose.x, pose.y),
        )
        self._traffic = (
            Traffic(ready.scene, flight.radius_m, lambda: self.observations) if ready.scene.traffic else None
        )
        drone = Drone(
            self._planner(question), flight, pose, odometry, roof_m=ready.blueprint.roof_m, movers=self._traffic
        )
        about = About("simulator", ready.scene.name, renderer, renderer_detail, self.sensors.label)
        super().__init__(episode_id, about, drone, flight, question.rig)

    def close(self) -> None:
        """Gives the physics client back."""
        self._world.close()

    def state_at_look(self, number: int) -> VehicleState:
        """As it measures itself at look `number`, which is about to be taken."""
        for fault in self.faults:
            if fault.kind == "pose_jump" and fault.first_look == number:
                self.drone.jump(fault.jump_m)
        return self.drone.state(self.id, self.moves, number)

    @property
    def time_s(self) -> float:
        """What the vehicle's clock shows."""
        return self.drone.clock_s(self.observations)

    def looked(self, number: int, pose: Pose) -> None:
        """Time goes on while a hovering drone looks, and so does what moves."""
        before_s = self.time_s
        super().looked(number, pose)
        self._watch_traffic(before_s)

    def _watch_traffic(self, before_s: float) -> None:
        if self._traffic is not None and not self.drone.flies:
            hit = self._traffic.strikes(_place(self.drone.pose), before_s, self.time_s)
            if hit is not None:
                self.drone.struck(hit)

    def has(self, fault: FaultKind, look: int) -> bool:
        """Whether that fault was asked for at that look."""
        return any(f.kind == fault and f.at(look) for f in self.faults)

    def put(self, report: PoseReport) -> PoseJudged:
        """The drone is where an autopilot outside has flown it to, through whatever is on that way; the ground is not
        hit by a drone that says that it stands there. Raises Conflict on its way, and after the claim."""
        self.must_stand("a pose from outside")
        if self.claimed:
            raise Conflict("a claim has ended this episode; the drone stays where it is", code="episode_claimed")
        here, there = self.drone.pose, report.pose
        end = (there.x, there.y, there.z)
        hit = self._world.sweep((here.x, here.y, here.z), end).hit or self._world.touching(end)
        hit = None if report.grounded and hit == GROUND else hit
        if hit is None and self._traffic is not None:
            hit = self._traffic.strikes(end, self.time_s, self.time_s)
        self.drone.put(there, hit)
        self._flown_outside = True
        return PoseJudged(collided=self.drone.collided, hit=hit)

    def _elsewhere(self, a: Pose, b: Pose) -> bool:
        """A drone that an autopilot outside flies never stands quite still."""
        if not self._flown_outside:
            return super()._elsewhere(a, b)
        gap_m = math.dist((a.x, a.y, a.z), (b.x, b.y, b.z))
        return gap_m > SAME_STOP_M or abs(wrapped(a.yaw - b.yaw)) > SAME_STOP_RAD

    def judged(self, target: Vector | None) -> Verdict:
        drone, ready = self.drone, self.ready
        verdict = judge(ready.scene, ready.things, self._world, drone.pose, drone.collided, target, self.steps)
        if not self._own_request:
            return verdict
        window = claimed_window(ready.scene, ready.things, self._world, drone.pose, target, names_of)
        return verdict.model_copy(update={"window": window})

    def _planner(self, question: EpisodeQuestion) -> Planner:
        """By dynamics where that is asked for, or where wind blows."""
        wind = self.ready.scene.air.wind
        blows = wind.speed_m_s > 0.0 or wind.gusts_m_s > 0.0
        model = question.flight.model or ("quadrotor" if blows else "kinematic")
        if model == "quadrotor":
            return Pilot(self._world, question.flight, wind, self.seeds)
        return KinematicPlanner(self._world, question.flight)


def _place(pose: Pose) -> Vector:
    return pose.x, pose.y, pose.z
