"""Does a process grow? All services for an hour, one delivery after the other, each in a street that is new.

    python -m tests.load.fleet_soak --minutes 60

Real services; the oracle answers most deliveries, the embedded model every fourth. Each delivery's events are listened
to, and the pages' lists, a picture and the figures are asked for. Memory is read once a second. Services give back once
a minute what they no longer need, so the least of each eighth of the time counts: of five minutes in an hour's run. The
code is 1 where a service grows by more than 1 MB an hour, the first third of the time left out.
"""

import argparse
import asyncio
import contextlib
import json
import statistics
import sys
import tempfile
import threading
import time
from collections.abc import Mapping
from itertools import groupby
from pathlib import Path
from typing import NamedTuple

import httpx

from contracts.sim import Catalogue
from evaluation.model_evaluation.cases import street
from launcher.processes import Processes, free_ports, oracle_settings
from service_kit.addresses import PORTS
from service_kit.settings import process_environment
from tests.system.orchestrator_process import OrchestratorDoor, heard

FIRST_SEED = 80_000
EMBEDDED_EVERY = 4
MB_AN_HOUR = 1.0
WINDOWS = 8
WARM_SHARE = 1 / 3
SETTLE_S = 1.0
SETTINGS = {"image_size": 160, "max_exploration_steps": 6}


class Sample(NamedTuple):
    """Memory of each service in MB, without mapped files, so many hours after the beginning."""

    hours: float
    deliveries: int
    mb: Mapping[str, float]


class Slope(NamedTuple):
    """MB an hour, and the standard error of that."""

    mb_an_hour: float
    error: float


def own_mb(pid: int) -> float:
    """What the kernel takes of mapped files back, and gives again, is not the service's doing."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return sum(int(line.split()[1]) for line in lines if line.startswith(("RssAnon:", "VmSwap:"))) / 1024


class Readings(threading.Thread):
    """Memory, once a second from now on; `deliveries`: how many are over."""

    def __init__(self, services: Processes) -> None:
        super().__init__(daemon=True)
        self._services = services
        self._began = time.monotonic()
        self.samples: list[Sample] = []
        self.deliveries = 0

    def run(self) -> None:
        # until the services have ended
        with contextlib.suppress(FileNotFoundError):
            while True:
                self.samples.append(read(self._services, (time.monotonic() - self._began) / 3600, self.deliveries))
                time.sleep(1.0)


def read(services: Processes, hours: float, deliveries: int) -> Sample:
    return Sample(hours, deliveries, {child.name: own_mb(child.process.pid) for child in services.children})


def slope(samples: list[Sample], service: str) -> Slope:
    """Of the least in each window."""
    first, wide = samples[0].hours, (samples[-1].hours - samples[0].hours) * 1.001 / WINDOWS
    windows = [list(window) for _, window in groupby(samples, key=lambda s: int((s.hours - first) / wide))]
    hours = [statistics.fmean(s.hours for s in window) for window in windows]
    mb = [min(s.mb[service] for s in window) for window in windows]
    line = statistics.linear_regression(hours, mb)
    left = [y - line.slope * x - line.intercept for x, y in zip(hours, mb, strict=True)]
    spread = sum((x - statistics.fmean(hours)) ** 2 for x in hours)
    return Slope(line.slope, (sum(y * y for y in left) / (len(left) - 2) / spread) ** 0.5)


def deliver(door: OrchestratorDoor, catalogue: Catalogue, number: int) -> str:
    """One delivery in a new street, looked at as a page does; its outcome."""
    new = street(FIRST_SEED + number, catalogue)
    request = f"Bring it to floor {new.floor}, the window with the {new.object}."
    backend = "embedded" if number % EMBEDDED_EVERY == 0 else "oracle"
    name = door.post(request=request, scene=new.scene.model_dump(mode="json"), backend=backend, settings=SETTINGS)
    events = heard(door, name)
    picture = next(file for event in events for file in event.pictures)
    paths = (f"/v1/deliveries/{name}/files/{picture}", "/v1/overview", "/v1/deliveries", "/v1/vehicles", "/metrics")
    for path in paths:
        httpx.get(door.url + path, timeout=30).raise_for_status()
    result = door.delivery(name).result
    assert result is not None
    return result.outcome


def soak(services: Processes, minutes: float, every_s: float) -> list[Sample]:
    urls = {child.name: child.url for child in services.children}
    catalogue = Catalogue.model_validate(httpx.get(f"{urls['sim']}/v1/catalogue", timeout=30).json())
    door = OrchestratorDoor(urls["orchestrator"])
    readings = Readings(services)
    readings.start()
    began = time.monotonic()
    while (now := time.monotonic()) < began + minutes * 60:
        outcome = deliver(door, catalogue, readings.deliveries)
        readings.deliveries += 1
        time.sleep(max(SETTLE_S, now + every_s - time.monotonic()))
        found = readings.samples[-1]
        say({"delivery": readings.deliveries, "outcome": outcome} | {k: round(v, 1) for k, v in found.mb.items()})
    return list(readings.samples)


def say(facts: Mapping[str, object]) -> None:
    sys.stdout.write(json.dumps(facts) + "\n")
    sys.stdout.flush()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--every", type=float, default=10.0, help="seconds from one post to the next, at least")
    asked = parser.parse_args()
    ports = free_ports(PORTS)
    with tempfile.TemporaryDirectory() as folder:
        extra = oracle_settings(ports) | {"orchestrator": {"RUNS_DIR": str(Path(folder) / "runs")}}
        extra["sim"] |= {"SIM_KEPT_SCENES": "0"}  # kept ones are large or small by chance
        extra["vlm_gateway"] |= {"CACHE_PATH": str(Path(folder) / "answers.sqlite")}
        services = Processes(ports, Path(folder) / "logs", environment=process_environment(), extra=extra)
        try:
            services.start()
            asyncio.run(services.ready())
            samples = soak(services, asked.minutes, asked.every)
        finally:
            services.stop()
    warm = samples[int(len(samples) * WARM_SHARE) :]
    slopes = {name: slope(warm, name) for name in ports}
    for name, found in slopes.items():
        first, last = warm[0].mb[name], warm[-1].mb[name]
        say(
            {"service": name, "mb": [round(first, 1), round(last, 1)]}
            | {k: round(v, 2) for k, v in found._asdict().items()}
        )
    say({"deliveries": samples[-1].deliveries, "from_hours": round(warm[0].hours, 2)})
    sys.exit(0 if all(found.mb_an_hour < MB_AN_HOUR for found in slopes.values()) else 1)


if __name__ == "__main__":
    main()
