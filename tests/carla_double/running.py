"""The double in a thread of its own, for tests and for the command beside."""

import asyncio
import socket
from collections.abc import Coroutine, Iterator, Sequence
from contextlib import contextmanager
from threading import Thread
from typing import Any

from contracts.scene import Scene
from services.sim.bootstrap import build_scene
from services.sim.render.choice import choose_renderer
from services.sim.render.thread import RenderThread
from services.sim.scenes import SceneBuilder
from tests.carla_double.simulation import Simulation

HOST = "127.0.0.1"


class RunningDouble:
    """`port`: of the remote calls."""

    def __init__(self, simulation: Simulation, loop: asyncio.AbstractEventLoop, port: int) -> None:
        self.simulation = simulation
        self.port = port
        self._loop = loop

    @property
    def address(self) -> str:
        return f"{HOST}:{self.port}"

    def run(self, job: Coroutine[Any, Any, Any]) -> Any:
        """In the double's own thread."""
        return asyncio.run_coroutine_threadsafe(job, self._loop).result(60)


@contextmanager
def running_double(
    maps: Sequence[Scene], build: SceneBuilder = build_scene, port: int | None = None, **options: Any
) -> Iterator[RunningDouble]:
    """Serves until it is left."""
    renderer = RenderThread(choose_renderer)
    simulation = Simulation(maps, build, renderer, **options)
    loop = asyncio.new_event_loop()
    thread = Thread(target=loop.run_forever, name="carla-double", daemon=True)
    thread.start()
    double = RunningDouble(simulation, loop, port or two_free_ports())
    try:
        double.run(simulation.start(HOST, double.port))
        yield double
    finally:
        double.run(simulation.stop())
        loop.call_soon_threadsafe(loop.stop)
        thread.join()
        loop.close()
        renderer.close()


def two_free_ports() -> int:
    """The first of two that follow each other."""
    while True:
        with socket.socket() as first, socket.socket() as second:
            first.bind((HOST, 0))
            port = int(first.getsockname()[1])
            try:
                second.bind((HOST, port + 1))
            except OSError:
                continue
            return port
