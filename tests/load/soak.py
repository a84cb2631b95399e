"""Does a process grow? All services for an hour, one delivery after the other, each in a street that is new.

    python -m tests.load.soak --minutes 60 --plot soak.svg

Real services; the oracle answers, and where it is asked for the embedded model every Nth delivery. Each delivery's
events are listened to, a page asks every five seconds what flies and where, and a picture, the street, the lists and
the figures are asked for. Memory is read once a second.
Services give back once a minute what they no longer need, so the least of each eighth of the time counts: of five
minutes in an hour's run, whose first third, while caches fill and code is first used, is left out. At the end of each
five minutes nothing is delivered for a minute, so that all has been given back once (not in runs under half an hour,
which are too short for it). The code is 0 where
every service's slope is under the bound with 95 % confidence, 1 where one grows by more with that confidence, and 2
where one can't be told from that: soak longer.
"""

import argparse
import asyncio
import contextlib
import json
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import httpx

from contracts.sim import Catalogue
from evaluation.model_evaluation.cases import street
from launcher.processes import Processes, free_ports, oracle_settings
from service_kit.addresses import PORTS
from service_kit.settings import process_environment
from service_kit.tidying import TIDY_EVERY_S
from tests.load.memory_slopes import WINDOWS, Memory, Sample, Slope, memory_of, plot, slope, table
from tests.system.orchestrator_process import OrchestratorDoor, heard

FIRST_SEED = 80_000
WARM_SHARE = 1 / 3
SETTLE_S = 1.0
REST_S = TIDY_EVERY_S + 10.0
"""Without deliveries; by its end each service has given back what it no longer needs."""
PAGE_EVERY_S = 5.0


class Pace(NamedTuple):
    """`every_s` from one post to the next, at least; the embedded model sees every `embedded_every`th, 0: none."""

    minutes: float
    every_s: float
    embedded_every: int
    image_size: int
    steps: int


class Soaked(NamedTuple):
    """What was seen; `outcomes`: how many deliveries ended so."""

    samples: list[Sample]
    outcomes: Mapping[str, int]


class Readings(threading.Thread):
    """Memory, once a second from now on; `deliveries`: how many are over."""

    def __init__(self, services: Processes) -> None:
        super().__init__(daemon=True)
        self._pids = {child.name: child.process.pid for child in services.children}
        self._began = time.monotonic()
        self.samples: list[Sample] = []
        self.deliveries = 0

    def run(self) -> None:
        # until the services have ended
        with contextlib.suppress(ProcessLookupError):
            while True:
                hours = (time.monotonic() - self._began) / 3600
                found = {name: memory_of(pid) for name, pid in self._pids.items()}
                self.samples.append(Sample(hours, self.deliveries, found))
                time.sleep(1.0)


class Page(threading.Thread):
    """Asks every now and then what flies and where, as a page that is open does, until the orchestrator has ended."""

    def __init__(self, url: str) -> None:
        super().__init__(daemon=True)
        self._url = url

    def run(self) -> None:
        with contextlib.suppress(httpx.TransportError):
            while True:
                httpx.get(f"{self._url}/v1/overview", timeout=60)
                time.sleep(PAGE_EVERY_S)


def deliver(door: OrchestratorDoor, catalogue: Catalogue, number: int, pace: Pace) -> str:
    """One delivery in a new street, looked at as a page does; its outcome."""
    new = street(FIRST_SEED + number, catalogue)
    request = f"Bring it to floor {new.floor}, the window with the {new.object}."
    backend = "embedded" if pace.embedded_every and number % pace.embedded_every == 0 else "oracle"
    settings = {"image_size": pace.image_size, "max_exploration_steps": pace.steps}
    name = door.post(request=request, scene=new.scene.model_dump(mode="json"), backend=backend, settings=settings)
    events = heard(door, name)
    pictures = [f"files/{file}" for event in events for file in event.pictures][:1]
    own = [f"/v1/deliveries/{name}/{part}" for part in (*pictures, "street", "tracking")]
    paths = (*own, "/v1/overview", "/v1/deliveries", "/v1/vehicles", "/metrics")
    for path in paths:
        httpx.get(door.url + path, timeout=60).raise_for_status()
    result = door.delivery(name).result
    assert result is not None
    return result.outcome


def rest_s(minutes: float, since_s: float, rests: int) -> float:
    """Seconds to rest now, after so many rests: there is one at the end of each stretch of the time, as many as the
    fit's windows and those before them; 0 while none is due, and where stretches are too short for it."""
    stretch_s = minutes * 60 * (1 - WARM_SHARE) / WINDOWS
    ends_s = (rests + 1) * stretch_s
    if stretch_s < 2 * REST_S or since_s < ends_s - REST_S:
        return 0.0
    return max(REST_S, ends_s - since_s)


def soak(services: Processes, pace: Pace) -> Soaked:
    urls = {child.name: child.url for child in services.children}
    catalogue = Catalogue.model_validate(httpx.get(f"{urls['sim']}/v1/catalogue", timeout=30).json())
    door = OrchestratorDoor(urls["orchestrator"])
    outcomes = Counter[str]()
    readings = Readings(services)
    readings.start()
    Page(door.url).start()
    began, rests = time.monotonic(), 0
    while (now := time.monotonic()) < began + pace.minutes * 60:
        outcomes[deliver(door, catalogue, readings.deliveries, pace)] += 1
        readings.deliveries += 1
        time.sleep(max(SETTLE_S, now + pace.every_s - time.monotonic()))
        if not readings.is_alive():
            sys.stderr.write(
                f"\na service has ended by itself after {readings.deliveries} deliveries: nothing is measured\n"
            )
            sys.exit(3)
        _progress(readings.samples[-1])
        rest = rest_s(pace.minutes, time.monotonic() - began, rests)
        if rest:
            rests += 1
            time.sleep(rest)
    return Soaked(list(readings.samples), dict(outcomes))


def _progress(found: Sample) -> None:
    services = ", ".join(f"{name} {memory.own:.1f}" for name, memory in found.services.items())
    sys.stderr.write(f"\r{60 * found.hours:.1f} min, {found.deliveries} deliveries, MB: {services} ")
    sys.stderr.flush()


def run(pace: Pace, sim: Mapping[str, str]) -> Soaked:
    """Services started, soaked and stopped; `sim`: the simulator's settings."""
    ports = free_ports(PORTS)
    with tempfile.TemporaryDirectory() as folder:
        extra = oracle_settings(ports) | {"orchestrator": {"RUNS_DIR": str(Path(folder) / "runs")}}
        extra["sim"] |= sim
        extra["vlm_gateway"] |= {"CACHE_PATH": str(Path(folder) / "answers.sqlite")}
        services = Processes(ports, Path(folder) / "logs", environment=process_environment(), extra=extra)
        try:
            services.start()
            asyncio.run(services.ready())
            return soak(services, pace)
        finally:
            services.stop()


def document(soaked: Soaked, warm: Sequence[Sample], slopes: Mapping[str, Slope], bound: float) -> dict[str, object]:
    """What `--json` writes: slopes in MB an hour, and of each minute the least own memory and RSS, MB."""
    minutes = sorted({int(sample.hours * 60) for sample in soaked.samples})
    by_minute = {minute: [s for s in soaked.samples if int(s.hours * 60) == minute] for minute in minutes}
    return {
        "outcomes": soaked.outcomes,
        "warm_from_hours": round(warm[0].hours, 3),
        "windows": WINDOWS,
        "deliveries_fitted": warm[-1].deliveries - warm[0].deliveries,
        "slopes": {
            name: {k: round(v, 3) for k, v in found._asdict().items()} | {"verdict": found.verdict(bound)}
            for name, found in slopes.items()
        },
        "least_by_minute": {
            name: [
                [minute, *(round(min(column), 2) for column in zip(*_memory(of, name), strict=True))]
                for minute, of in by_minute.items()
            ]
            for name in slopes
        },
    }


def _memory(samples: Sequence[Sample], service: str) -> list[Memory]:
    return [sample.services[service] for sample in samples]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--every", type=float, default=15.0, help="seconds from one post to the next, at least")
    parser.add_argument("--embedded-every", type=int, default=0, metavar="N", help="the embedded model sees every Nth")
    parser.add_argument("--image-size", type=int, default=160, metavar="PIXELS")
    parser.add_argument("--steps", type=int, default=3, help="of the search round a building, at most")
    parser.add_argument("--kept-scenes", type=int, default=0, help="built scenes that stay, large or small by chance")
    parser.add_argument("--bound", type=float, default=1.0, metavar="MB", help="an hour (default: %(default)s)")
    parser.add_argument("--json", action="store_true", help="a JSON document in place of the table")
    parser.add_argument("--plot", type=Path, metavar="FILE", help="memory over time: a PNG, SVG or PDF")
    asked = parser.parse_args()
    pace = Pace(asked.minutes, asked.every, asked.embedded_every, asked.image_size, asked.steps)
    soaked = run(pace, {"SIM_KEPT_SCENES": str(asked.kept_scenes)})
    warm = soaked.samples[int(len(soaked.samples) * WARM_SHARE) :]
    slopes = {name: slope(warm, name) for name in PORTS}
    sys.stderr.write("\n")
    bound = asked.bound
    ended = ", ".join(f"{count} {outcome}" for outcome, count in soaked.outcomes.items())
    found = table(slopes, warm, bound) + f"\ndeliveries: {ended}"
    if asked.json:
        found = json.dumps(document(soaked, warm, slopes, bound))
    sys.stdout.write(found + "\n")
    if asked.plot:
        plot(asked.plot, soaked.samples, warm, slopes)
    verdicts = {found.verdict(bound) for found in slopes.values()}
    sys.exit(1 if "grows" in verdicts else 2 if "undecided" in verdicts else 0)


if __name__ == "__main__":
    main()
