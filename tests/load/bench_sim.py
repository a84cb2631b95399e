"""`python -m tests.load.bench_sim [--json] [--scene FILE] [--rounds N]`: how fast five RGB-D views are.

Three ways to the same five 800 x 800 views of the same scene from the same pose, taken in turn within one run, so
that whatever else the machine does hits all of them:

- a loop of PyBullet's `getCameraImage(renderer=ER_TINY_RENDERER)` over the scene's own triangles, shadows off;
- the simulator's renderer, in process;
- the simulator as a process, over real HTTP, JPEG and zstd and JSON included, until the last byte is here.

The medians and the two ratios are printed; the exit status is 1 where a goal is missed.
"""

import argparse
import http.client
import json
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple
from urllib.parse import urlsplit

import pybullet
from rich.console import Console
from rich.table import Table

from contracts.cameras import shipped_rig
from contracts.geometry import Pose
from contracts.images import decode_depth, decode_jpeg
from contracts.orchestrator import Sample
from contracts.scene import Scene
from contracts.sim import Episode, EpisodeQuestion
from contracts.vehicle import Observation
from services.sim.bootstrap import build_scene
from services.sim.geometry.scene_mesh import SceneMesh
from services.sim.render.choice import choose_renderer
from services.sim.render.tiny import TinyScene
from services.sim.render.views import view_axes
from tests.load.processes import service

SAMPLE = Path(__file__).parents[2] / "orchestrator" / "samples" / "green-flower-pot.json"
CAMERAS = shipped_rig("paper-five").cameras
SIZE = CAMERAS[0].width
GOAL_IN_PROCESS = 8.0
GOAL_OVER_HTTP = 6.0


class Figures(NamedTuple):
    """Median seconds for five views each way, and what was drawn."""

    tiny_s: float
    in_process_s: float
    http_s: float
    http_render_s: float
    http_encode_s: float
    decode_s: float
    answer_bytes: int
    triangles: int
    rounds: int
    renderer: str

    @property
    def ratio_in_process(self) -> float:
        return self.tiny_s / self.in_process_s

    @property
    def ratio_over_http(self) -> float:
        return self.tiny_s / self.http_s


class TinyLoop:
    """The baseline: one PyBullet client with the scene's triangles as bodies, and five calls a round."""

    def __init__(self, mesh: SceneMesh) -> None:
        self._scene = TinyScene(mesh)

    def __call__(self, pose: Pose) -> None:
        lens = pybullet.computeProjectionMatrixFOV(90.0, 1.0, 0.1, 400.0)
        eye = (pose.x, pose.y, pose.z)
        for camera in CAMERAS:
            ahead = view_axes(pose, camera)[2]
            target = [a + b for a, b in zip(eye, ahead, strict=True)]
            view = pybullet.computeViewMatrix(eye, target, (0, 0, 1))
            pybullet.getCameraImage(
                SIZE,
                SIZE,
                view,
                lens,
                shadow=0,
                renderer=pybullet.ER_TINY_RENDERER,
                physicsClientId=self._scene.client,
            )

    def close(self) -> None:
        self._scene.release()


class Door:
    """A kept-alive connection to the simulator's process."""

    def __init__(self, url: str, scene: Scene) -> None:
        address = urlsplit(url)
        self._http = http.client.HTTPConnection(address.hostname or "", address.port, timeout=60)
        question = EpisodeQuestion(scene=scene).model_dump_json().encode()
        started = self._ask("POST", "/v1/episodes", question)
        self.episode = Episode.model_validate_json(started)
        self.pose = self.episode.vehicle.pose

    def observe(self) -> bytes:
        return self._ask("GET", f"/v1/episodes/{self.episode.id}/observation")

    def _ask(self, method: str, path: str, body: bytes | None = None) -> bytes:
        self._http.request(method, path, body, {"Content-Type": "application/json"} if body else {})
        answer = self._http.getresponse()
        data = answer.read()
        if answer.status >= 400:
            raise SystemExit(f"{method} {path}: {answer.status} {data[:500].decode(errors='replace')}")
        return data


def timed(job: Callable[[], Any]) -> tuple[float, Any]:
    started = time.perf_counter()
    result = job()
    return time.perf_counter() - started, result


def measure(scene: Scene, rounds: int, tick: Callable[[str], None]) -> Figures:
    """Builds everything once, warms each way up once, then takes the three ways in turn."""
    tick("building the scene")
    mesh = build_scene(scene)
    with ExitStack() as stack:
        renderer = choose_renderer()
        stack.callback(renderer.close)
        uploaded = renderer.upload(mesh)
        tiny = TinyLoop(mesh)
        stack.callback(tiny.close)
        door = Door(stack.enter_context(service("services.sim", {"SIM_RENDERER": "auto"})).url, scene)
        pose = door.pose
        ways: dict[str, Callable[[], Any]] = {
            "tiny": lambda: tiny(pose),
            "in_process": lambda: renderer.render(uploaded, pose, CAMERAS),
            "http": door.observe,
        }
        took: dict[str, list[float]] = {name: [] for name in (*ways, "render", "encode", "decode")}
        answer = b""
        for number in range(rounds + 1):
            tick(f"round {number} of {rounds}" if number else "warming up")
            for name, way in ways.items():
                seconds, result = timed(way)
                if number:
                    took[name].append(seconds)
                if name == "http":
                    answer = result
            if number:
                seconds, seen = timed(partial(_decoded, answer))
                took["decode"].append(seconds)
                took["render"].append(seen.timings_s["render"])
                took["encode"].append(seen.timings_s["encode"])
        return Figures(
            tiny_s=median(took["tiny"]),
            in_process_s=median(took["in_process"]),
            http_s=median(took["http"]),
            http_render_s=median(took["render"]),
            http_encode_s=median(took["encode"]),
            decode_s=median(took["decode"]),
            answer_bytes=len(answer),
            triangles=mesh.mesh.triangle_count,
            rounds=rounds,
            renderer=renderer.detail,
        )


def _decoded(data: bytes) -> Observation:
    seen = Observation.model_validate_json(data)
    for view in seen.views:
        decode_jpeg(view.image)
        if view.depth is not None:
            decode_depth(view.depth)
    return seen


def shown(figures: Figures) -> Table:
    table = Table(title=f"five {SIZE} x {SIZE} RGB-D views, {figures.triangles} triangles, {figures.rounds} rounds")
    for heading in ("way", "median", "times TinyRenderer", "goal"):
        table.add_column(heading, justify="left" if heading == "way" else "right")
    table.add_row("PyBullet TinyRenderer, a loop", f"{figures.tiny_s * 1e3:.0f} ms", "1.0", "")
    table.add_row(
        f"in process, {figures.renderer}",
        f"{figures.in_process_s * 1e3:.0f} ms",
        f"{figures.ratio_in_process:.1f}",
        f">= {GOAL_IN_PROCESS:g}",
    )
    table.add_row(
        f"over HTTP, encoded ({figures.answer_bytes / 1e6:.1f} MB)",
        f"{figures.http_s * 1e3:.0f} ms",
        f"{figures.ratio_over_http:.1f}",
        f">= {GOAL_OVER_HTTP:g}",
    )
    table.caption = (
        f"of the HTTP call: render {figures.http_render_s * 1e3:.0f} ms, encode {figures.http_encode_s * 1e3:.0f} ms; "
        f"reading it takes the caller {figures.decode_s * 1e3:.0f} ms more"
    )
    return table


def scene_of(path: Path) -> Scene:
    """The scene of a sample delivery, or a bare scene document."""
    text = path.read_text(encoding="utf-8")
    return Sample.model_validate_json(text).scene if "scene" in json.loads(text) else Scene.model_validate_json(text)


def main() -> None:
    parser = argparse.ArgumentParser(description="Five RGB-D views: TinyRenderer, in process, over HTTP.")
    parser.add_argument("--json", action="store_true", help="one JSON object on standard output")
    parser.add_argument("--scene", type=Path, default=SAMPLE, help="a sample delivery or a scene document")
    parser.add_argument("--rounds", type=int, default=9)
    options = parser.parse_args()
    progress = Console(stderr=True)
    with progress.status("starting") as status:
        figures = measure(scene_of(options.scene), max(1, options.rounds), status.update)
    met = figures.ratio_in_process >= GOAL_IN_PROCESS and figures.ratio_over_http >= GOAL_OVER_HTTP
    if options.json:
        ratios = {
            "ratio_in_process": figures.ratio_in_process,
            "ratio_over_http": figures.ratio_over_http,
            "goals_met": met,
        }
        sys.stdout.write(json.dumps(figures._asdict() | ratios) + "\n")
    else:
        Console().print(shown(figures))
    sys.exit(0 if met else 1)


if __name__ == "__main__":
    main()
