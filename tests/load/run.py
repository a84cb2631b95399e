"""`python -m tests.load.run [--json] [--seconds N]`: every service at its real payloads, requests/s and latencies.

Services run as processes pinned to one core, the load generator has the other. Payloads come from a real flight's
first observation. Each route is measured alone (one connection) and then open-loop at 60 % of what it did alone.
"""

import argparse
import asyncio
import base64
import json
import os
import sys
import tempfile
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

import aiohttp
from pydantic import BaseModel
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from contracts.depth_assist import ApproachQuestion, SafeDistancesQuestion, ViewDepth, ViewpointQuestion
from contracts.geometry import POINT_LABELS, Box
from contracts.images import JpegImage, jpeg_bytes
from contracts.llm_parser import ParseQuestion
from contracts.orchestrator import Sample
from contracts.sim import Episode, EpisodeQuestion
from contracts.vehicle import Move, Observation
from contracts.vlm_gateway import (
    BuildingBoxQuestion,
    ChooseDirectionQuestion,
    FindObjectQuestion,
    FloorCountQuestion,
    MarkedPoint,
    View,
)
from tests.load.open_loop import Call, Load, alone, open_loop
from tests.load.processes import service

SAMPLE = Path(__file__).parents[2] / "orchestrator" / "samples" / "green-flower-pot.json"
SHARE_OF_CAPACITY = 0.6
MODULES = {
    "llm_parser": "services.llm_parser",
    "vlm_gateway": "services.vlm_gateway",
    "depth_assist": "services.depth_assist",
    "sim": "services.sim",
}


class Route(NamedTuple):
    """A route under load; `ordered` ones (moves) are sent one after another only."""

    name: str
    call: Callable[[int], Call]
    ordered: bool = False


class Measured(NamedTuple):
    """One route's figures: alone, and under open-loop load where it has one."""

    route: str
    alone: Load
    loaded: Load | None


def post(url: str, *bodies: BaseModel) -> Callable[[int], Call]:
    """POSTs the bodies in turn."""
    ready = [body.model_dump_json().encode() for body in bodies]
    return lambda i: Call("POST", url, ready[i % len(ready)])


async def first_observation(session: aiohttp.ClientSession, sim: str, sample: Sample) -> tuple[str, Observation]:
    """A fresh episode of the sample and what the drone sees from the start, raised to 4 m."""
    question = EpisodeQuestion(scene=sample.scene).model_dump_json()
    headers = {"Content-Type": "application/json"}
    async with session.post(f"{sim}/v1/episodes", data=question, headers=headers) as answer:
        answer.raise_for_status()
        episode = Episode.model_validate_json(await answer.read())
    up = Move(path=(sample.scene.start.position.model_copy(update={"z": 4.0}),), yaw=sample.scene.start.yaw)
    path = f"{sim}/v1/episodes/{episode.id}"
    async with session.put(f"{path}/moves/1", data=up.model_dump_json(), headers=headers) as answer:
        answer.raise_for_status()
    async with session.get(f"{path}/observation") as answer:
        answer.raise_for_status()
        return episode.id, Observation.model_validate_json(await answer.read())


def routes(urls: dict[str, str], sample: Sample, episode: str, seen: Observation) -> list[Route]:
    """Every route with the payload that a delivery sends."""
    depths = tuple(ViewDepth(camera=v.camera, depth=v.depth) for v in seen.views if v.depth is not None)
    front = next(v for v in seen.views if v.camera.name == "front")
    front_depth = next(d for d in depths if d.camera.name == "front")
    views = tuple(View(camera=v.camera, image=v.image) for v in seen.views)
    marks = tuple(
        MarkedPoint(label=label, x=(k + 1) / 6, y=0.5, distance_m=6.0) for k, label in enumerate(POINT_LABELS)
    )
    parser, gateway, depth, sim = (urls[name] for name in MODULES)
    box = Box(x_min=0.45, y_min=0.45, x_max=0.55, y_max=0.55)
    half_turns = [Move(yaw=sample.scene.start.yaw + turn).model_dump_json().encode() for turn in (0.3, 0.0)]
    task = "find the window with the green flower pot"
    choose = ChooseDirectionQuestion(camera=front.camera, image=front.image, points=marks, task=task)
    return [
        Route("llm_parser POST /v1/parse", post(f"{parser}/v1/parse", ParseQuestion(request=sample.request))),
        Route("depth_assist POST /v1/viewpoint", post(f"{depth}/v1/viewpoint", ViewpointQuestion(views=depths))),
        Route(
            "depth_assist POST /v1/safe-distances",
            post(f"{depth}/v1/safe-distances", SafeDistancesQuestion(view=front_depth)),
        ),
        Route(
            "depth_assist POST /v1/approach",
            post(f"{depth}/v1/approach", ApproachQuestion(view=front_depth, box=box, pose=seen.pose)),
        ),
        Route(
            "vlm_gateway POST /v1/floor-count",
            post(f"{gateway}/v1/floor-count", FloorCountQuestion(image=front.image)),
        ),
        Route(
            "vlm_gateway POST /v1/building-box",
            post(f"{gateway}/v1/building-box", BuildingBoxQuestion(image=front.image)),
        ),
        # new pictures each time: of known ones the model remembers what it saw
        Route(
            "vlm_gateway POST /v1/find-object (embedded model, new pictures)",
            lambda i: Call(
                "POST",
                f"{gateway}/v1/find-object",
                FindObjectQuestion(object="green flower pot", views=tuple(remarked(v, i) for v in views))
                .model_dump_json()
                .encode(),
            ),
        ),
        Route(
            "vlm_gateway POST /v1/find-object (cache hit)",
            post(f"{gateway}/v1/find-object", FindObjectQuestion(object="green flower pot", views=views)),
        ),
        Route("vlm_gateway POST /v1/choose-direction", post(f"{gateway}/v1/choose-direction", choose)),
        Route(
            "sim GET /v1/episodes/{id}/observation (5 RGB-D 800x800)",
            lambda _: Call("GET", f"{sim}/v1/episodes/{episode}/observation"),
        ),
        Route(
            "sim PUT /v1/episodes/{id}/moves/{n}",
            lambda i: Call("PUT", f"{sim}/v1/episodes/{episode}/moves/{i + 2}", half_turns[i % 2]),
            ordered=True,
        ),
        Route("orchestrator GET /v1/deliveries", lambda _: Call("GET", f"{urls['orchestrator']}/v1/deliveries")),
    ]


def remarked(view: View, number: int) -> View:
    """The same picture as another file: a comment after the JPEG's first marker."""
    comment = f"{number:012d}".encode()
    mark = b"\xff\xfe" + (len(comment) + 2).to_bytes(2, "big") + comment
    file = jpeg_bytes(view.image)
    image = JpegImage(jpeg_base64=base64.b64encode(file[:2] + mark + file[2:]).decode())
    return View(camera=view.camera, image=image)


async def measure(session: aiohttp.ClientSession, route: Route, seconds: float, report: Callable[[], None]) -> Measured:
    """Alone for about `seconds`, then open-loop for about `seconds`."""
    warm = 3
    first = await alone(session, route.call, warm)
    count = max(10, min(2000, int(seconds * 1000 / max(first.p50_ms, 0.1))))
    single = await alone(session, lambda i: route.call(i + warm), count)
    report()
    loaded = None
    if not route.ordered:
        rate = SHARE_OF_CAPACITY * single.done_per_s
        many = max(10, min(4000, int(rate * seconds)))
        loaded = await open_loop(session, lambda i: route.call(i + warm + count), rate, many)
    report()
    return Measured(route.name, single, loaded)


async def run(seconds: float, console: Console) -> list[Measured]:
    """All services up, all routes measured."""
    cores = sorted(os.sched_getaffinity(0))
    sample = Sample.model_validate_json(SAMPLE.read_bytes())
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        environment = {"CACHE_PATH": str(folder / "cache.sqlite"), "RUNS_DIR": str(folder / "runs"), "REDIS_URL": ""}
        urls = {
            name: stack.enter_context(service(module, environment, cores[-1])).url for name, module in MODULES.items()
        }
        at = {f"{name.upper()}_URL": url for name, url in urls.items()}
        urls["orchestrator"] = stack.enter_context(service("orchestrator", environment | at, cores[-1])).url
        os.sched_setaffinity(0, {cores[0]})
        connector = aiohttp.TCPConnector(limit=0)
        async with aiohttp.ClientSession(connector=connector) as session:
            episode, seen = await first_observation(session, urls["sim"], sample)
            table = routes(urls, sample, episode, seen)
            with Progress(console=console, transient=True) as progress:
                bar = progress.add_task("load", total=2 * len(table))
                return [await measure(session, route, seconds, lambda: progress.advance(bar)) for route in table]


def main() -> None:
    """Print the table, or one JSON object."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true", help="print one JSON object instead of a table")
    parser.add_argument("--seconds", type=float, default=4.0, help="about how long each of a route's two parts takes")
    options = parser.parse_args()
    measured = asyncio.run(run(options.seconds, Console(stderr=True)))
    if options.json:
        rows = [
            {"route": m.route, "alone": m.alone._asdict(), "loaded": m.loaded._asdict() if m.loaded else None}
            for m in measured
        ]
        sys.stdout.write(json.dumps({"routes": rows}, indent=2) + "\n")
        return
    table = Table(title=f"services on one core; open loop at {SHARE_OF_CAPACITY:.0%} of what one connection reached")
    for name in ("route", "alone/s", "p50 ms", "offered/s", "done/s", "p50 ms", "p95 ms", "p99 ms", "failed"):
        table.add_column(name, justify="left" if name == "route" else "right")
    for m in measured:
        failed = m.alone.failed + (m.loaded.failed if m.loaded else 0)
        under = m.loaded
        cells = [f"{v:.1f}" for v in under[:2]] + [f"{v:.1f}" for v in under[4:]] if under else ["-"] * 5
        table.add_row(m.route, f"{m.alone.done_per_s:.1f}", f"{m.alone.p50_ms:.1f}", *cells, str(failed))
    Console(width=150).print(table)


if __name__ == "__main__":
    main()
