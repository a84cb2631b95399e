"""A placement whose vehicle is recorded as it is flown: every look with all cameras, every move, the claim."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from contracts.geometry import Point3
from contracts.sim import Verdict
from contracts.vehicle import Move, MoveResult, Observation, VehicleCapabilities
from mission.placement import Placement
from mission.ports import ServiceUnreachable
from mission.trajectory import TrajectoryWriter
from mission.vehicle import Progress, Vehicle
from mission.vehicles.decorated import DecoratedPlacement, DecoratedVehicle


@contextmanager
def kept_on_disk() -> Iterator[None]:
    """A disk that takes no more is infrastructure that fails, and says nothing about whoever is asked and flown. Raises
    ServiceUnreachable instead of OSError."""
    try:
        yield
    except OSError as error:
        raise ServiceUnreachable(f"what was seen can't be kept: {error.strerror or error}") from error


class RecordedVehicle(DecoratedVehicle):
    """A vehicle, recorded. It always looks with all its cameras, so that every stop of the recording has the same
    pictures; whoever flies it gets those asked for, as from the vehicle itself."""

    def __init__(self, vehicle: Vehicle, trajectory: TrajectoryWriter) -> None:
        super().__init__(vehicle)
        self._trajectory = trajectory

    async def connect(self) -> VehicleCapabilities:
        capabilities = await super().connect()
        with kept_on_disk():
            self._trajectory.begun(capabilities)
        return capabilities

    async def observe(self, cameras: Sequence[str] | None = None, *, depth: bool = True) -> Observation:
        seen = await super().observe()
        views = {view.camera.name: view for view in seen.views}
        asked = tuple(name for name in (views if cameras is None else cameras) if name in views)
        if not asked:  # the vehicle knows best how to refuse what it has not got
            return await super().observe(cameras, depth=depth)
        with kept_on_disk():
            self._trajectory.seen(seen, asked)
        wanted = tuple(views[name] if depth else views[name].model_copy(update={"depth": None}) for name in asked)
        return seen.model_copy(update={"views": wanted})

    async def fly(self, number: int, move: Move, progress: Progress | None = None) -> MoveResult:
        done = await super().fly(number, move, progress)
        with kept_on_disk():
            self._trajectory.flown(move, done)
        return done


class RecordedPlacement(DecoratedPlacement):
    """Another placement, its vehicle and its claim recorded."""

    def __init__(self, placement: Placement, trajectory: TrajectoryWriter) -> None:
        super().__init__(placement)
        self._trajectory = trajectory

    def _before(self, vehicle: Vehicle) -> Vehicle:
        return RecordedVehicle(vehicle, self._trajectory)

    async def claim(self, vehicle: str, target: Point3 | None) -> Verdict | None:
        verdict = await super().claim(vehicle, target)
        with kept_on_disk():
            self._trajectory.claimed(target, verdict)
        return verdict
