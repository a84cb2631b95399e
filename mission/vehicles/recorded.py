"""A placement whose vehicle is recorded as it is flown: every look with all cameras, every move, the claim."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

from contracts.geometry import Point3
from contracts.sim import Verdict
from contracts.vehicle import Move, MoveResult, Observation, VehicleCapabilities, VehicleState
from mission.placement import Placement
from mission.ports import ServiceUnreachable
from mission.trajectory import TrajectoryWriter
from mission.vehicle import Progress, Vehicle


@contextmanager
def kept_on_disk() -> Iterator[None]:
    """A disk that takes no more is infrastructure that fails, and says nothing about whoever is asked and flown. Raises
    ServiceUnreachable instead of OSError."""
    try:
        yield
    except OSError as error:
        raise ServiceUnreachable(f"what was seen can't be kept: {error.strerror or error}") from error


class RecordedVehicle:
    """A vehicle, recorded. It always looks with all its cameras, so that every stop of the recording has the same
    pictures; whoever flies it gets those asked for, as from the vehicle itself."""

    def __init__(self, vehicle: Vehicle, trajectory: TrajectoryWriter) -> None:
        self._vehicle = vehicle
        self._trajectory = trajectory

    @property
    def name(self) -> str:
        return self._vehicle.name

    async def connect(self) -> VehicleCapabilities:
        capabilities = await self._vehicle.connect()
        with kept_on_disk():
            self._trajectory.begun(capabilities)
        return capabilities

    async def state(self) -> VehicleState:
        return await self._vehicle.state()

    async def take_off(self, height_m: float) -> VehicleState:
        return await self._vehicle.take_off(height_m)

    async def observe(self, cameras: Sequence[str] | None = None, *, depth: bool = True) -> Observation:
        seen = await self._vehicle.observe()
        views = {view.camera.name: view for view in seen.views}
        asked = tuple(name for name in (views if cameras is None else cameras) if name in views)
        if not asked:  # the vehicle knows best how to refuse what it has not got
            return await self._vehicle.observe(cameras, depth=depth)
        with kept_on_disk():
            self._trajectory.seen(seen, asked)
        wanted = tuple(views[name] if depth else views[name].model_copy(update={"depth": None}) for name in asked)
        return seen.model_copy(update={"views": wanted})

    async def fly(self, number: int, move: Move, progress: Progress | None = None) -> MoveResult:
        done = await self._vehicle.fly(number, move, progress)
        with kept_on_disk():
            self._trajectory.flown(move, done)
        return done

    async def hold(self) -> VehicleState:
        return await self._vehicle.hold()

    async def return_home(self) -> VehicleState:
        return await self._vehicle.return_home()

    async def land(self) -> VehicleState:
        return await self._vehicle.land()

    async def release(self) -> None:
        await self._vehicle.release()


@dataclass(frozen=True)
class RecordedPlacement:
    """Another placement, its vehicle and its claim recorded."""

    placement: Placement
    trajectory: TrajectoryWriter

    @property
    def rig_name(self) -> str | None:
        return self.placement.rig_name

    @property
    def sensors_name(self) -> str | None:
        return self.placement.sensors_name

    async def begin(self, key: str) -> Vehicle:
        return RecordedVehicle(await self.placement.begin(key), self.trajectory)

    async def resume(self, vehicle: str) -> Vehicle:
        return RecordedVehicle(await self.placement.resume(vehicle), self.trajectory)

    async def renderer(self, vehicle: str) -> str | None:
        return await self.placement.renderer(vehicle)

    async def claim(self, vehicle: str, target: Point3 | None) -> Verdict | None:
        verdict = await self.placement.claim(vehicle, target)
        with kept_on_disk():
            self.trajectory.claimed(target, verdict)
        return verdict
