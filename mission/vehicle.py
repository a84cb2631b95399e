"""What a mission flies: a vehicle; and, where a simulator judges it, a trial.

Both are ports: the implementations live in `mission.vehicles`, and `tests/agreements/test_vehicles.py` runs over all of
them. Every method may raise `PortError`.
"""

from collections.abc import Callable, Sequence
from typing import Protocol

from contracts.geometry import Point3
from contracts.sim import EpisodeQuestion, Verdict
from contracts.vehicle import Move, MoveProgress, MoveResult, Observation, VehicleCapabilities, VehicleState

Progress = Callable[[MoveProgress], None]


class Vehicle(Protocol):
    """One drone. Its name is stable, so that another process can take the mission on."""

    @property
    def name(self) -> str: ...

    async def connect(self) -> VehicleCapabilities:
        """Makes sure that it answers. Doing it again does no harm."""
        ...

    async def state(self) -> VehicleState:
        """Pose with its uncertainty, battery, health, what was flown so far."""
        ...

    async def take_off(self, height_m: float) -> VehicleState:
        """A vehicle that flies already stays where it is."""
        ...

    async def observe(self, cameras: Sequence[str] | None = None, *, depth: bool = True) -> Observation:
        """One moment's views of these cameras by name; all without them."""
        ...

    async def fly(self, number: int, move: Move, progress: Progress | None = None) -> MoveResult:
        """Move `number` (1, 2, ...); the same number again is the same move. When the awaiting task is cancelled, the
        vehicle stops on the way and holds, as far as it can (`VehicleCapabilities.cancels_moves`)."""
        ...

    async def hold(self) -> VehicleState: ...

    async def return_home(self) -> VehicleState: ...

    async def land(self) -> VehicleState: ...

    async def release(self) -> None:
        """The mission needs it no more; a vehicle that is gone already is no error."""
        ...


class Trial(Protocol):
    """A vehicle in a scene that a simulator knows, and its judge. Only a simulator has one."""

    async def begin(self, question: EpisodeQuestion) -> Vehicle:
        """The drone at the scene's start. The same `key` again is the same trial: nothing is begun twice."""
        ...

    async def resume(self, vehicle: str) -> Vehicle:
        """The vehicle of that name, of a trial that was begun before, perhaps by another process."""
        ...

    async def renderer(self, vehicle: str) -> str | None:
        """Who draws its pictures; null where nobody does."""
        ...

    async def claim(self, vehicle: str, target: Point3 | None) -> Verdict:
        """The mission says: this is the window. Ends the trial; the first claim counts."""
        ...
