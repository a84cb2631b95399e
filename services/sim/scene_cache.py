"""Built scenes, shared by the episodes that fly in them, and kept a while for the next ones."""

import asyncio
from collections.abc import Callable
from concurrent.futures import Executor
from typing import TypeVar

from contracts.scene import Scene
from service_kit.errors import BadQuestion, Unavailable
from services.sim.render.thread import RendererBusy, RenderThread
from services.sim.render.views import Renderer, Uploaded
from services.sim.scenes import ReadyScene, SceneBuilder, make_ready, scene_key

T = TypeVar("T")


class CachedScene:
    """A scene in both memories, the processor's and the renderer's; `users` episodes fly in it."""

    def __init__(self, ready: ReadyScene, uploaded: Uploaded) -> None:
        self.ready = ready
        self.uploaded = uploaded
        self.users = 0


class SceneCache:
    """Those that nobody uses stay, `keep` of them at most, the longest unused goes first."""

    def __init__(self, build: SceneBuilder, renderer: RenderThread, workers: Executor, keep: int) -> None:
        self._build = build
        self._renderer = renderer
        self._workers = workers
        self._keep = keep
        self._scenes: dict[str, CachedScene] = {}
        self._building = asyncio.Lock()

    async def acquire(self, scene: Scene) -> CachedScene:
        """Built now where it isn't there yet, one at a time. Raises BadQuestion or Unavailable."""
        key = scene_key(scene)
        if key not in self._scenes:
            async with self._building:
                if key not in self._scenes:
                    loop = asyncio.get_running_loop()
                    ready = await loop.run_in_executor(self._workers, make_ready, scene, self._build)
                    self._scenes[key] = CachedScene(ready, await self._upload(ready))
        cached = self._scenes[key]
        cached.users += 1
        return cached

    async def release(self, cached: CachedScene) -> None:
        """Once for each `acquire`."""
        cached.users -= 1
        key = cached.ready.key
        if cached.users == 0 and self._scenes.get(key) is cached:
            self._scenes[key] = self._scenes.pop(key)  # the last to have been used
        unused = [k for k, s in self._scenes.items() if s.users == 0]
        for old in unused[: max(0, len(unused) - self._keep)]:
            gone = self._scenes.pop(old)
            try:
                await self._unload(gone)
            except Unavailable:
                self._scenes.setdefault(old, gone)  # it goes when the next scene is released
                break

    def __len__(self) -> int:
        return len(self._scenes)

    async def _upload(self, ready: ReadyScene) -> Uploaded:
        try:
            return await draw(self._renderer, lambda renderer: renderer.upload(ready.mesh))
        except ValueError as error:
            raise BadQuestion(f"the scene can't be drawn: {error}", code="bad_scene") from None

    async def _unload(self, cached: CachedScene) -> None:
        await draw(self._renderer, lambda _: cached.uploaded.release())


async def draw(renderer: RenderThread, job: Callable[[Renderer], T]) -> T:
    """A job on the renderer's thread. Raises Unavailable where too many wait there."""
    try:
        future = renderer.submit(job)
    except RendererBusy as error:
        raise Unavailable(f"no picture can be drawn now: {error}; try again shortly", code="renderer_busy") from None
    return await asyncio.wrap_future(future)
