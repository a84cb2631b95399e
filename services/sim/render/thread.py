"""A thread of its own for the renderer, because an OpenGL context belongs to the thread that made it."""

from collections.abc import Callable
from concurrent.futures import Future
from queue import Full, Queue
from threading import Thread
from typing import Any, TypeVar

from services.sim.render.views import Renderer

T = TypeVar("T")
_Job = tuple[Callable[[Renderer], Any], "Future[Any]"]


class RendererBusy(RuntimeError):
    """More pictures are asked for than wait in line here; ask again later."""


class RenderThread:
    """Runs jobs one after the other, each with the renderer: `await asyncio.wrap_future(thread.submit(job))`.

    The constructor waits until `make` has made the renderer, in the thread. Raises what `make` raises.
    """

    def __init__(self, make: Callable[[], Renderer], max_waiting: int = 64) -> None:
        self._jobs: Queue[_Job | None] = Queue(max_waiting)
        ready: Future[Renderer] = Future()
        self._thread = Thread(target=self._work, args=(make, ready), name="renderer", daemon=True)
        self._thread.start()
        made = ready.result()
        self.name, self.detail = made.name, made.detail

    def submit(self, job: Callable[[Renderer], T]) -> "Future[T]":
        """The job's result, later. Raises RendererBusy when too many wait already, or after `close`."""
        future: Future[T] = Future()
        if not self._thread.is_alive():
            raise RendererBusy("the renderer has been closed")
        try:
            self._jobs.put_nowait((job, future))
        except Full:
            raise RendererBusy(f"{self._jobs.maxsize} pictures are waiting already") from None
        return future

    def run(self, job: Callable[[Renderer], T]) -> T:
        """`submit`, then wait. Raises what the job raises."""
        return self.submit(job).result()

    def close(self) -> None:
        """Finishes what waits, then ends the thread and the renderer."""
        if self._thread.is_alive():
            self._jobs.put(None)
            self._thread.join()

    def _work(self, make: Callable[[], Renderer], ready: "Future[Renderer]") -> None:
        try:
            renderer = make()
        except BaseException as error:
            ready.set_exception(error)
            return
        ready.set_result(renderer)
        while (item := self._jobs.get()) is not None:
            _do(renderer, *item)
            del item  # while the next job is waited for, the last one's scene and pictures are nobody's
        renderer.close()


def _do(renderer: Renderer, job: Callable[[Renderer], Any], future: "Future[Any]") -> None:
    if future.set_running_or_notify_cancel():
        try:
            future.set_result(job(renderer))
        except BaseException as error:
            future.set_exception(error)
