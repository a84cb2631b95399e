"""A trial and its vehicle by the simulator's episodes."""

from collections.abc import Sequence

from contracts.cameras import Rig
from contracts.geometry import Point3
from contracts.scene import Scene
from contracts.sim import Claim, Episode, EpisodeQuestion, Flight, Verdict
from contracts.vehicle import Move, MoveResult, Observation, VehicleCapabilities, VehicleState
from mission.ports import World
from mission.vehicle import Progress, Vehicle


class EpisodeTrial:
    """Begins episodes, each with its vehicle, and claims in them."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._begun: dict[str, EpisodeVehicle] = {}
        self._episodes: dict[str, Episode] = {}

    async def begin(self, key: str, scene: Scene, flight: Flight, rig: Rig) -> Vehicle:
        if key not in self._begun:
            episode = await self._world.start(EpisodeQuestion(scene=scene, flight=flight, rig=rig))
            self._begun[key] = EpisodeVehicle(self._world, episode, rig)
            self._episodes[episode.id] = episode
        return self._begun[key]

    async def resume(self, vehicle: str) -> Vehicle:
        return next(v for v in self._begun.values() if v.name == vehicle)

    async def renderer(self, vehicle: str) -> str | None:
        return self._episodes[vehicle].renderer

    async def claim(self, vehicle: str, target: Point3 | None) -> Verdict:
        return await self._world.claim(vehicle, Claim(target=target))


class EpisodeVehicle:
    def __init__(self, world: World, episode: Episode, rig: Rig) -> None:
        self._world, self._state, self._rig = world, episode.vehicle, rig

    @property
    def name(self) -> str:
        return self._state.id

    async def connect(self) -> VehicleCapabilities:
        return VehicleCapabilities(
            kind="simulator",
            cameras=self._rig.cameras,
            radius_m=0.35,
            max_speed_m_s=4.0,
            cancels_moves=False,
            lands=False,
        )

    async def state(self) -> VehicleState:
        return self._state

    async def take_off(self, height_m: float) -> VehicleState:
        return self._state

    async def observe(self, cameras: Sequence[str] | None = None, *, depth: bool = True) -> Observation:
        return await self._world.observe(self.name, cameras or [c.name for c in self._rig.cameras])

    async def fly(self, number: int, move: Move, progress: Progress | None = None) -> MoveResult:
        done = await self._world.move(self.name, number, move)
        self._state = done.vehicle
        return done

    async def hold(self) -> VehicleState:
        return self._state

    async def return_home(self) -> VehicleState:
        return self._state

    async def land(self) -> VehicleState:
        return self._state

    async def release(self) -> None:
        await self._world.end(self.name)
