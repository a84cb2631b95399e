"""A trial and its vehicle by the simulator's episodes."""

from collections.abc import Sequence

from contracts.cameras import Rig
from contracts.geometry import VIEW_HEADINGS_DEG, Heading, Point3
from contracts.scene import Scene
from contracts.sim import Claim, Episode, EpisodeQuestion, Flight, Verdict
from contracts.sim import Move as EpisodeMove
from contracts.vehicle import Move, MoveResult, Observation, SensedView, VehicleCapabilities, VehicleState
from mission.ports import World
from mission.vehicle import Progress, Vehicle

_HEADINGS: dict[float, Heading] = {float(heading): heading for heading in VIEW_HEADINGS_DEG}


class EpisodeTrial:
    """Begins episodes, each with its vehicle, and claims in them."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._begun: dict[str, EpisodeVehicle] = {}
        self._episodes: dict[str, Episode] = {}

    async def begin(self, key: str, scene: Scene, flight: Flight, rig: Rig) -> Vehicle:
        if key not in self._begun:
            episode = await self._world.start(EpisodeQuestion(scene=scene, flight=flight))
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
        self._world, self._episode, self._rig = world, episode, rig

    @property
    def name(self) -> str:
        return self._episode.id

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
        return _state(self._episode)

    async def take_off(self, height_m: float) -> VehicleState:
        return _state(self._episode)

    async def observe(self, cameras: Sequence[str] | None = None, *, depth: bool = True) -> Observation:
        wanted = [self._rig.camera(name) for name in cameras or [c.name for c in self._rig.cameras]]
        headings = tuple(_HEADINGS[c.heading_deg] for c in wanted)
        seen = await self._world.observe(self.name, headings=headings, size=wanted[0].width)
        by_heading = {c.heading_deg: c for c in wanted}
        views = tuple(
            SensedView(camera=by_heading[v.heading_deg].scaled_to(seen.camera.width), image=v.image, depth=v.depth)
            for v in seen.views
        )
        return Observation(
            vehicle=self.name, number=seen.number, pose=seen.pose, views=views, timings_s={"render": seen.render_s}
        )

    async def fly(self, number: int, move: Move, progress: Progress | None = None) -> MoveResult:
        done = await self._world.move(self.name, number, EpisodeMove(path=move.path, yaw=move.yaw))
        self._episode = done.episode
        return MoveResult(
            number=done.number,
            pose=done.pose,
            reached=done.reached,
            collided=done.collided,
            hit=done.hit,
            path_m=done.path_m,
            flight_s=done.flight_s,
            vehicle=_state(done.episode),
        )

    async def hold(self) -> VehicleState:
        return _state(self._episode)

    async def return_home(self) -> VehicleState:
        return _state(self._episode)

    async def land(self) -> VehicleState:
        return _state(self._episode)

    async def release(self) -> None:
        await self._world.end(self.name)


def _state(episode: Episode) -> VehicleState:
    return VehicleState(
        id=episode.id,
        mode="holding",
        pose=episode.pose,
        moves=episode.moves,
        path_m=episode.path_m,
        path_horizontal_m=episode.path_horizontal_m,
        flight_s=episode.flight_s,
        collided=episode.collided,
    )
