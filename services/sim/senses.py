"""What the drone of one episode sees, and, for the oracle, what is really there."""

import asyncio
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from typing import NamedTuple, TypeVar

from contracts.cameras import Camera
from contracts.geometry import Pose
from contracts.sim import Truth, TruthQuestion
from contracts.vehicle import Observation, SensedView
from episode_kit.cameras import chosen_cameras
from service_kit.errors import BadQuestion
from services.sim.episode import LiveEpisode
from services.sim.render.thread import RenderThread
from services.sim.render.views import check_cameras
from services.sim.scene_cache import CachedScene, draw
from services.sim.sensors.suite import Look, SensorSuite, frames_of
from services.sim.truth import Ids, truth_view

T = TypeVar("T")


class _Labels(NamedTuple):
    """The ids that were drawn beside the last pictures: until the drone moves they are the truth's pictures too, and
    where there is traffic, of the same moment."""

    pose: Pose
    time_s: float
    views: dict[Camera, Ids]


class _Taken(NamedTuple):
    """Views of one moment, and what the vehicle's clock showed then."""

    views: tuple[SensedView, ...]
    time_s: float
    timings_s: dict[str, float]


class Senses:
    """One call at a time. `labelled`: the truth will be asked, so every look keeps what each pixel shows."""

    def __init__(
        self, episode: LiveEpisode, cached: CachedScene, renderer: RenderThread, workers: Executor, *, labelled: bool
    ) -> None:
        self._episode = episode
        self._cached = cached
        self._renderer = renderer
        self._workers = workers
        self._labelled = labelled
        self._labels: _Labels | None = None
        self._sensor = SensorSuite(episode.sensors, episode.seeds, episode.ready.scene.air)
        self._frozen: _Taken | None = None

    async def look(self, cameras: Sequence[str] | None, depth: bool) -> Observation:
        """The named cameras' views of one moment, also on the way; all of the rig's where none are named. Raises
        BadQuestion or Unavailable."""
        episode = self._episode
        chosen = chosen_cameras(episode.rig.cameras, cameras)
        number = episode.observations + 1
        frozen = episode.has("frozen", number)
        state, pose, time_s = episode.state_at_look(number), episode.drone.pose, episode.drone.clock_s(number)
        if not frozen:
            self._frozen = None
        elif self._frozen is None:
            self._frozen = await self._taken(episode.rig.cameras, number, pose, time_s, depth=True)
        taken = self._frozen or await self._taken(chosen, number, pose, time_s, depth=depth)
        by_name = {view.camera.name: view if depth else view.model_copy(update={"depth": None}) for view in taken.views}
        episode.looked(number, pose)
        return Observation(
            vehicle=episode.id,
            number=number,
            pose=state.pose,
            time_s=taken.time_s,
            uncertainty=state.uncertainty,
            views=tuple(by_name[camera.name] for camera in chosen),
            timings_s=taken.timings_s,
        )

    async def _taken(
        self, chosen: tuple[Camera, ...], number: int, pose: Pose, time_s: float, *, depth: bool
    ) -> _Taken:
        """Draws, and senses and encodes each picture and each depth map as work of its own: OpenCV and the encoders let
        other threads run meanwhile."""
        episode, uploaded = self._episode, self._cached.uploaded
        labelled, panes = self._labelled, self._sensor.tells_panes
        moving = episode.drone.rates
        started = time.perf_counter()
        drawn = await draw(
            self._renderer,
            lambda renderer: renderer.render(uploaded, pose, chosen, time_s, labelled=labelled, panes=panes),
        )
        if drawn.ids is not None:
            self._labels = _Labels(pose, time_s, dict(zip(chosen, drawn.ids, strict=True)))
        rendered = time.perf_counter()
        look = Look(number, pose, moving, blind=episode.has("no_depth", number))
        seen = list(zip(frames_of(drawn), chosen, strict=True))
        images = [self._work(self._sensor.picture, *one, look) for one in seen]
        depths = [self._work(self._sensor.depth, *one, look) for one in seen] if depth else []
        jpegs = await asyncio.gather(*images)
        maps = await asyncio.gather(*depths) if depth else [None] * len(jpegs)
        views = tuple(
            SensedView(camera=camera, image=image, depth=depth_map)
            for camera, image, depth_map in zip(chosen, jpegs, maps, strict=True)
        )
        timings_s = {"render": rendered - started, "encode": time.perf_counter() - rendered}
        return _Taken(views, time_s, timings_s)

    async def truth(self, question: TruthQuestion) -> Truth:
        """Raises BadQuestion or Unavailable."""
        uploaded, ready, drone = self._cached.uploaded, self._cached.ready, self._episode.drone
        pose, moves = drone.pose, self._episode.moves
        cameras = question.cameras
        if cameras:
            check(cameras)
        time_s = self._episode.time_s
        known = self._labels
        if known is None or known.pose != pose or (ready.mesh.moving and known.time_s != time_s):
            known = _Labels(pose, time_s, {})
        missing = tuple(camera for camera in dict.fromkeys(cameras) if camera not in known.views)
        if missing:
            ids = await draw(self._renderer, lambda renderer: renderer.render_ids(uploaded, pose, missing, time_s))
            known.views.update(zip(missing, ids, strict=True))
            self._labels = known

        def found() -> Truth:
            views = tuple(
                truth_view(ready.scene, ready.mesh, ready.things, pose, camera, known.views[camera])
                for camera in cameras
            )
            candidates = [drone.true(place) for place in question.candidates]
            remaining_m = ready.way_home.remaining_m(candidates)
            return Truth(scene=ready.scene.name, moves=moves, pose=pose, views=views, remaining_m=remaining_m)

        return await self._work(found)

    async def _work(self, job: Callable[..., T], *arguments: object) -> T:
        return await asyncio.get_running_loop().run_in_executor(self._workers, job, *arguments)


def check(cameras: Sequence[Camera]) -> None:
    """Raises BadQuestion for cameras that can't be drawn."""
    try:
        check_cameras(cameras)
    except ValueError as error:
        raise BadQuestion(str(error), code="bad_rig") from None
