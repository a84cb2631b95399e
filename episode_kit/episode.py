"""One trial: a drone in a scene, from its start to its claim. Rules of the flight, without clocks, threads or pictures;
each simulated world adds its scene and its judge."""

from abc import ABC, abstractmethod
from typing import Literal, NamedTuple

from contracts.cameras import Rig
from contracts.geometry import Pose
from contracts.sim import Claim, Episode, Flight, Renderer, Verdict
from contracts.vehicle import Move, MoveProgress, MoveResult, VehicleCapabilities, VehicleState
from episode_kit.drone import Drone
from episode_kit.kinematics import Vector
from episode_kit.lease import Lease
from episode_kit.trajectory import Flown
from service_kit.errors import Conflict, NotFound


class About(NamedTuple):
    """What a trial tells of its world: the fields of `contracts.sim.Episode` of these names, and the vehicle's kind."""

    kind: str
    scene: str
    renderer: Renderer
    renderer_detail: str
    sensors: str


class _Numbered(NamedTuple):
    """The last numbered move, and what came of it; null while it is flown. `move` is null for a number that was
    cancelled before anybody sent its move. `share`: how much of it was flown."""

    move: Move | None
    result: MoveResult | None
    share: float = 0.0


class FlyingEpisode(ABC):
    """Not thread-safe: one call at a time; only `advance` and what tells without changing may come meanwhile."""

    def __init__(self, episode_id: str, about: About, drone: Drone, flight: Flight, rig: Rig) -> None:
        self.id = episode_id
        self.drone = drone
        self.flight = flight
        self.rig = rig
        self.observations = 0
        self.steps = 0
        self._about = about
        self._looked_at: Pose | None = None
        self._moves = 0
        self._last: _Numbered | None = None
        self._verdict: Verdict | None = None

    @abstractmethod
    def judged(self, target: Vector | None) -> Verdict:
        """The verdict on a claim made where the drone is, for an object that truly is at `target` (null: the stop alone
        is judged)."""

    @property
    def moves(self) -> int:
        """The number of the last move begun."""
        return self._moves

    def capabilities(self) -> VehicleCapabilities:
        return VehicleCapabilities(
            kind=self._about.kind,
            cameras=self.rig.cameras,
            radius_m=self.flight.radius_m,
            max_speed_m_s=self.flight.max_speed_m_s,
            cancels_moves=True,
            lands=True,
        )

    def state(self) -> VehicleState:
        """The drone as it measures itself, also on the way."""
        return self.drone.state(self.id, self._moves, self.observations)

    def looked(self, number: int, pose: Pose) -> None:
        """Look `number` was taken at this true pose. Looks at one pose are one stop."""
        self.observations = number
        if self._looked_at is None or self._elsewhere(self._looked_at, pose):
            self.steps += 1
            self._looked_at = pose

    def _elsewhere(self, a: Pose, b: Pose) -> bool:
        """Another stop."""
        return a != b

    def trial(self, lease: Lease) -> Episode:
        """What the trial adds to the drone."""
        return Episode(
            id=self.id,
            status="flying" if self._verdict is None else "claimed",
            scene=self._about.scene,
            renderer=self._about.renderer,
            renderer_detail=self._about.renderer_detail,
            flight=self.flight,
            rig=self.rig.name,
            sensors=self._about.sensors,
            lease_s=lease.lease_s,
            expires_in_s=lease.left_s,
            vehicle=self.state(),
        )

    def must_stand(self, what: str) -> None:
        """Raises Conflict while a flight is under way, of which `what` has to wait for the end."""
        if self.drone.flies:
            raise Conflict(
                f"{what} has to wait: the drone is on its way; let it arrive, or stop it with POST .../hold",
                code="move_under_way",
            )

    @property
    def claimed(self) -> bool:
        """A claim has ended it."""
        return self._verdict is not None

    def begin(self, number: int, move: Move) -> MoveResult | None:
        """Begins move `number`, or tells again what came of it; null where it is under way. Raises Conflict for any
        other number, for another move under the last number, on the ground, and after the claim."""
        if self._last is not None and number == self._moves:
            if self._last.move in (move, None):
                return self._last.result
            raise Conflict(
                f"move {number} was already sent with another body; the next move is {self._moves + 1}",
                code="move_differs",
                details={"expected": self._moves + 1},
            )
        if self._verdict is not None:
            raise Conflict("a claim has ended this episode; the drone flies no more moves", code="episode_claimed")
        if number != self._moves + 1:
            raise Conflict(
                f"move {number} is out of order; the next move is {self._moves + 1}",
                code="move_out_of_order",
                details={"expected": self._moves + 1},
            )
        self.must_stand(f"move {number}")
        self._must_have_power()
        if self.drone.landed:
            raise Conflict("the drone stands on the ground; POST .../take-off first", code="landed")
        self.drone.move(move.path, move.yaw)
        self._moves, self._last = number, _Numbered(move, None)
        return None

    def take_off(self, height_m: float) -> None:
        """Begins to; a drone that flies stays where it is. Raises Conflict while a flight is under way."""
        self.must_stand("taking off")
        self._must_have_power()
        if self.drone.landed:
            self.drone.take_off(height_m)

    def return_home(self) -> None:
        """Begins to; a drone on the ground stays there. Raises Conflict while a flight is under way."""
        self.must_stand("returning")
        self._must_have_power()
        if not self.drone.landed:
            self.drone.return_home()

    def land(self) -> None:
        """Begins to. Raises Conflict while a flight is under way."""
        self.must_stand("landing")
        if not self.drone.landed:
            self.drone.land()

    def advance(self, time_s: float) -> bool:
        """The flight under way, to `time_s` seconds after it was begun; says whether none is left."""
        flown = self.drone.advance(time_s)
        if flown is not None:
            self._finish(flown, share=1.0, cancelled=False)
        return not self.drone.flies

    def stop(self) -> None:
        """Brakes on the way, and holds. A move that was under way is cancelled."""
        share = self.drone.share
        flown = self.drone.stop()
        if flown is not None:
            self._finish(flown, share=share, cancelled=True)

    def cancel(self, number: int) -> MoveResult:
        """Stops move `number` on the way; one that is over already stays what it is. The next number is used up
        before its move is sent, so that a cancellation that overtakes its move still holds. Raises NotFound."""
        if number == self._moves + 1 and not self.drone.flies:
            self._moves, self._last = number, _Numbered(None, None)
            self._finish(Flown(self.drone.pose, 0.0, 0.0, 0.0, None), share=0.0, cancelled=True)
        if self._numbered(number).result is None:
            self.stop()
        return self.result(number)

    def result(self, number: int) -> MoveResult:
        """What came of the last move, which is over. Raises NotFound for any other."""
        result = self._numbered(number).result
        if result is None:
            raise Conflict(f"move {number} is under way", code="move_under_way")
        return result

    def progress(self, number: int) -> MoveProgress:
        """How far the last move has come. Raises NotFound for any other."""
        numbered = self._numbered(number)
        result = numbered.result
        if result is None:
            return MoveProgress(number=number, state="flying", pose=self.state().pose, share=self.drone.share)
        state: Literal["done", "cancelled"] = "cancelled" if result.cancelled else "done"
        return MoveProgress(number=number, state=state, pose=result.pose, share=numbered.share)

    def claim(self, claim: Claim) -> Verdict:
        """Judges and ends the episode; only the first claim counts, later ones get its verdict again. Raises Conflict
        on the way."""
        if self._verdict is None:
            self.must_stand("claiming")
            place = self.drone.true(claim.target) if claim.target else None
            self._verdict = self.judged((place.x, place.y, place.z) if place else None)
        return self._verdict

    def _finish(self, flown: Flown, *, share: float, cancelled: bool) -> None:
        """Writes down what came of a numbered move; other flights leave nothing to be told again."""
        numbered = self._last
        if numbered is None or numbered.result is not None:
            return
        state = self.state()
        result = MoveResult(
            number=self._moves,
            pose=state.pose,
            reached=flown.hit is None and not cancelled,
            cancelled=cancelled,
            collided=flown.hit is not None,
            hit=flown.hit,
            path_m=flown.path_m,
            flight_s=flown.flight_s,
            vehicle=state,
        )
        self._last = _Numbered(numbered.move, result, share)

    def _numbered(self, number: int) -> _Numbered:
        if self._last is None or number != self._moves:
            known = f"only the last one, {self._moves}, is remembered" if self._moves else "none was sent yet"
            raise NotFound(f"there is no move {number}; {known}", code="no_such_move")
        return self._last

    def _must_have_power(self) -> None:
        if self.drone.empty:
            raise Conflict("the battery is empty: the drone only lands, POST .../land", code="battery_empty")
