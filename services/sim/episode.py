"""One drone in one scene, from its start to its claim: state and rules, without clocks, threads or pictures."""

from contracts.geometry import Pose
from contracts.sim import Claim, Episode, Flight, Move, MoveResult, Renderer, Verdict
from service_kit.errors import Conflict
from services.sim.drone import fly
from services.sim.judge import judge
from services.sim.kinematics import wrapped
from services.sim.odometry import Odometry
from services.sim.scenes import ReadyScene, check_start
from services.sim.world import World


class LiveEpisode:
    """Not thread-safe: one call at a time. `expires_in_s` is told by whoever keeps the clock. `pose` is the true one;
    the world outside is told the one that `odometry` believes."""

    def __init__(
        self, episode_id: str, ready: ReadyScene, flight: Flight, renderer: Renderer, renderer_detail: str
    ) -> None:
        """Raises BadQuestion for a start that is not in the open air."""
        self.id = episode_id
        self.ready = ready
        self.observations = 0
        start = ready.scene.start
        self.pose = Pose(x=start.position.x, y=start.position.y, z=start.position.z, yaw=wrapped(start.yaw))
        self.odometry = Odometry(flight.drift, (ready.scene.seed, flight.drift_seed))
        self._flight = flight
        self._renderer: Renderer = renderer
        self._renderer_detail = renderer_detail
        self._moves = 0
        self._path_m = self._path_horizontal_m = self._flight_s = 0.0
        self._collided = False
        self._last: tuple[Move, MoveResult] | None = None
        self._verdict: Verdict | None = None
        self._world = World(ready.blueprint, flight.radius_m)
        try:
            check_start(ready, self._world)
        except BaseException:
            self._world.close()
            raise

    @property
    def moves(self) -> int:
        """How many the drone has made."""
        return self._moves

    def close(self) -> None:
        """Gives the physics client back."""
        self._world.close()

    def state(self, expires_in_s: float) -> Episode:
        """As it stands now."""
        return Episode(
            id=self.id,
            status="flying" if self._verdict is None else "claimed",
            scene=self.ready.scene.name,
            pose=self.odometry.believed(self.pose),
            moves=self._moves,
            path_m=self._path_m,
            path_horizontal_m=self._path_horizontal_m,
            flight_s=self._flight_s,
            collided=self._collided,
            renderer=self._renderer,
            renderer_detail=self._renderer_detail,
            flight=self._flight,
            expires_in_s=max(0.0, expires_in_s),
        )

    def move(self, number: int, move: Move, expires_in_s: float) -> MoveResult:
        """Flies move `number`, or tells again what came of it. Raises Conflict for any other number, for another
        move under the last number, and after the claim."""
        if self._last is not None and number == self._moves:
            sent, result = self._last
            if sent == move:
                return result
            raise Conflict(
                f"move {number} was already flown with another body; the next move is {self._moves + 1}",
                code="move_differs",
                details={"expected": self._moves + 1},
            )
        if self._verdict is not None:
            raise Conflict("a claim has ended this episode; the drone flies no more", code="episode_claimed")
        if number != self._moves + 1:
            raise Conflict(
                f"move {number} is out of order; the next move is {self._moves + 1}",
                code="move_out_of_order",
                details={"expected": self._moves + 1},
            )
        # the corners are meant in the frame that the drone believes in as it sets out
        path = tuple(self.odometry.true(corner) for corner in move.path)
        flown = fly(self._world, self._flight, self.pose, Move(path=path, yaw=move.yaw))
        self.pose = flown.pose
        self.odometry.flown(flown.path_horizontal_m)
        self._moves = number
        self._path_m += flown.path_m
        self._path_horizontal_m += flown.path_horizontal_m
        self._flight_s += flown.flight_s
        self._collided = self._collided or flown.hit is not None
        result = MoveResult(
            number=number,
            pose=self.odometry.believed(flown.pose),
            reached=flown.hit is None,
            collided=flown.hit is not None,
            hit=flown.hit,
            path_m=flown.path_m,
            flight_s=flown.flight_s,
            episode=self.state(expires_in_s),
        )
        self._last = (move, result)
        return result

    def claim(self, claim: Claim, expires_in_s: float) -> Verdict:
        """Judges and ends the episode; only the first claim counts, later ones get its verdict again."""
        if self._verdict is None:
            scene, things = self.ready.scene, self.ready.things
            place = self.odometry.true(claim.target) if claim.target else None
            target = (place.x, place.y, place.z) if place else None
            found = judge(scene, things, self._world, self.pose, self._collided, target)
            ended = self.state(expires_in_s).model_copy(update={"status": "claimed"})
            self._verdict = Verdict(**found._asdict(), collided=self._collided, episode=ended)
        return self._verdict
