"""Where a mission gets its drone from: a trial in a simulator, or a vehicle of its own. The mission itself never sees
what a trial knows."""

from dataclasses import dataclass
from typing import Protocol

from contracts.cameras import Rig
from contracts.geometry import Point3
from contracts.scene import Scene
from contracts.sim import Flight, Verdict
from mission.vehicle import Trial, Vehicle


class Placement(Protocol):
    """A drone for one mission, and whoever judges its claim. Every method may raise PortError."""

    @property
    def rig_name(self) -> str | None:
        """Which cameras a simulated drone was given; null where a vehicle brings its own."""
        ...

    async def begin(self, key: str) -> Vehicle:
        """The drone at its start. The same `key` again is the same drone."""
        ...

    async def resume(self, vehicle: str) -> Vehicle:
        """The drone of that name, which `begin` gave before, perhaps to another process."""
        ...

    async def renderer(self, vehicle: str) -> str | None:
        """Who draws the pictures, where a simulator does."""
        ...

    async def claim(self, vehicle: str, target: Point3 | None) -> Verdict | None:
        """The mission says: this is the window. The same claim again is the same verdict; null where nobody judges."""
        ...


@dataclass(frozen=True)
class InTrial:
    """The drone of a trial: scene, flight and rig go to the trial as they are."""

    trial: Trial
    scene: Scene
    flight: Flight
    rig: Rig

    @property
    def rig_name(self) -> str | None:
        return self.rig.name

    async def begin(self, key: str) -> Vehicle:
        return await self.trial.begin(key, self.scene, self.flight, self.rig)

    async def resume(self, vehicle: str) -> Vehicle:
        return await self.trial.resume(vehicle)

    async def renderer(self, vehicle: str) -> str | None:
        return await self.trial.renderer(vehicle)

    async def claim(self, vehicle: str, target: Point3 | None) -> Verdict | None:
        return await self.trial.claim(vehicle, target)


@dataclass(frozen=True)
class OwnVehicle:
    """A vehicle that stands ready, and nobody to judge: the mission ends as delivered, not judged."""

    vehicle: Vehicle

    @property
    def rig_name(self) -> str | None:
        return None

    async def begin(self, key: str) -> Vehicle:
        return self.vehicle

    async def resume(self, vehicle: str) -> Vehicle:
        return self.vehicle

    async def renderer(self, vehicle: str) -> str | None:
        return None

    async def claim(self, vehicle: str, target: Point3 | None) -> Verdict | None:
        return None
