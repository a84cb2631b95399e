"""Where a mission gets its drone from: a trial in a simulator, or a vehicle of its own. The mission itself never sees
what a trial knows."""

from dataclasses import dataclass
from typing import Protocol

from contracts.geometry import Point3
from contracts.orchestrator import MissionSettings
from contracts.scene import Scene
from contracts.sim import EpisodeQuestion, Verdict
from mission.vehicle import Trial, Vehicle


class Placement(Protocol):
    """A drone for one mission, and whoever judges its claim. Every method may raise PortError."""

    @property
    def rig_name(self) -> str | None:
        """Which cameras a simulated drone was given; null where a vehicle brings its own."""
        ...

    @property
    def sensors_name(self) -> str | None:
        """Which sensor profile, and which version of it, a simulated drone was given; null likewise."""
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


def trial_question(scene: Scene, settings: MissionSettings, *, own_request: bool = False) -> EpisodeQuestion:
    """What a mission of these settings asks a simulator for. `own_request`: the goal was set for other words."""
    return EpisodeQuestion(
        scene=scene,
        flight=settings.flight,
        rig=settings.rig_flown,
        sensors=settings.sensors,
        seed=settings.seed,
        faults=settings.faults,
        own_request=own_request,
    )


@dataclass(frozen=True)
class InTrial:
    """The drone of a trial: the question goes to the trial as it is, with the mission's key."""

    trial: Trial
    question: EpisodeQuestion

    @property
    def rig_name(self) -> str | None:
        return self.question.rig.name

    @property
    def sensors_name(self) -> str | None:
        return self.question.sensors_flown.label

    async def begin(self, key: str) -> Vehicle:
        return await self.trial.begin(self.question.model_copy(update={"key": key}))

    async def resume(self, vehicle: str) -> Vehicle:
        return await self.trial.resume(vehicle)

    async def renderer(self, vehicle: str) -> str | None:
        return await self.trial.renderer(vehicle)

    async def claim(self, vehicle: str, target: Point3 | None) -> Verdict | None:
        return await self.trial.claim(vehicle, target)


@dataclass(frozen=True)
class OwnVehicle:
    """A vehicle that stands ready, and nobody to judge: the mission ends as stopped, not judged."""

    vehicle: Vehicle

    @property
    def rig_name(self) -> str | None:
        return None

    @property
    def sensors_name(self) -> str | None:
        return None

    async def begin(self, key: str) -> Vehicle:
        return self.vehicle

    async def resume(self, vehicle: str) -> Vehicle:
        return self.vehicle

    async def renderer(self, vehicle: str) -> str | None:
        return None

    async def claim(self, vehicle: str, target: Point3 | None) -> Verdict | None:
        return None
