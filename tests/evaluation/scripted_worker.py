"""A worker without a process, for the tests of who does what."""

from evaluation.bench.worker_pool import WorkerCantStart


class ScriptedWorkerBase:
    """Starts and stops in no time; can't start after `starts` starts."""

    def __init__(self, starts: int = 100) -> None:
        self._starts = starts
        self.running = False

    async def start(self) -> None:
        if self._starts == 0:
            raise WorkerCantStart("no port is free")
        self._starts -= 1
        self.running = True

    async def stop(self) -> None:
        self.running = False
