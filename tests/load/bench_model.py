"""`python -m tests.load.bench_model [--json] [--rounds N] [--scene FILE] [--weights DIR]`: seeing beside rendering.

The same five 800 x 800 views of a sample delivery, taken before its window, in turn within one run so that whatever
else the machine does hits both:

- rendered by the simulator's renderer, in process, all five in one call;
- looked at by the embedded model, from the JPEG files to the sightings of one phrase, one thread, nothing remembered;
- asked about again with another phrase, which costs no look.

CPU time of this process, all its threads; the medians, the ratio, and what part decoding takes. The exit status is 1
where five views take more than the mark.
"""

import argparse
import json
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

from rich.console import Console
from rich.table import Table

from contracts.geometry import Pose
from contracts.images import encode_jpeg, jpeg_bytes
from contracts.scene import Scene
from services.sim.bootstrap import build_scene
from services.sim.render.choice import choose_renderer
from services.vlm_gateway.backends.base import Picture
from services.vlm_gateway.backends.embedded import JpegShot
from services.vlm_gateway.embedded.exported import FOLDER
from services.vlm_gateway.embedded.model import EmbeddedModel
from tests.load.bench_sim import CAMERAS, SAMPLE, SIZE, scene_of

MARK_MS = 150.0
PHRASE, OTHER_PHRASE = "green flower pot", "red kite"


class Figures(NamedTuple):
    """Median CPU milliseconds for five views; `sightings` of the phrase, as a sign of life."""

    render_ms: float
    render_wall_ms: float
    model_ms: float
    model_wall_ms: float
    decode_ms: float
    next_phrase_ms: float
    sightings: int
    rounds: int
    model: str
    renderer: str

    @property
    def ratio(self) -> float:
        return self.model_ms / self.render_ms


class Clocked(NamedTuple):
    cpu_s: float
    wall_s: float
    result: Any


def clocked(job: Callable[[], Any]) -> Clocked:
    wall, cpu = time.perf_counter(), time.process_time()
    result = job()
    return Clocked(time.process_time() - cpu, time.perf_counter() - wall, result)


def measure(scene: Scene, rounds: int, tick: Callable[[str], None], weights: Path = FOLDER) -> Figures:
    """Warms both up once, then takes them in turn."""
    tick("building the scene")
    mesh = build_scene(scene)
    start = scene.start
    pose = Pose(x=start.position.x, y=start.position.y, z=4.0, yaw=start.yaw)
    with ExitStack() as stack:
        renderer = choose_renderer()
        stack.callback(renderer.close)
        uploaded = renderer.upload(mesh)
        model = EmbeddedModel(weights, remembered=len(CAMERAS))
        took: dict[str, list[Clocked]] = {"render": [], "model": [], "decode": [], "next": []}
        for number in range(rounds + 1):
            tick(f"round {number} of {rounds}" if number else "warming up")
            drawn = clocked(lambda: renderer.render(uploaded, pose, CAMERAS))
            # another quality each round makes another file of the same picture: nothing is remembered
            files = [jpeg_bytes(encode_jpeg(rgb, 80 + number % 16)) for rgb in drawn.result.rgb]
            shots = [JpegShot(Picture(file, SIZE, SIZE)) for file in files]
            looked = clocked(lambda shots=shots: model.find_object(shots, PHRASE))
            again = clocked(lambda shots=shots: model.find_object(shots, OTHER_PHRASE))
            decoded = clocked(lambda shots=shots: [shot.rgb() for shot in shots])
            if number:
                for name, one in (("render", drawn), ("model", looked), ("next", again), ("decode", decoded)):
                    took[name].append(one)
        return Figures(
            render_ms=_ms(c.cpu_s for c in took["render"]),
            render_wall_ms=_ms(c.wall_s for c in took["render"]),
            model_ms=_ms(c.cpu_s for c in took["model"]),
            model_wall_ms=_ms(c.wall_s for c in took["model"]),
            decode_ms=_ms(c.cpu_s for c in took["decode"]),
            next_phrase_ms=_ms(c.cpu_s for c in took["next"]),
            sightings=len(took["model"][-1].result.sightings),
            rounds=rounds,
            model=model.version,
            renderer=renderer.detail,
        )


def _ms(seconds: Any) -> float:
    return round(1000 * median(seconds), 2)


def shown(figures: Figures) -> Table:
    table = Table(title=f"five {SIZE} x {SIZE} views, {figures.rounds} rounds")
    for heading in ("what", "CPU", "wall"):
        table.add_column(heading, justify="left" if heading == "what" else "right")
    table.add_row(f"rendered, {figures.renderer}", f"{figures.render_ms:.0f} ms", f"{figures.render_wall_ms:.0f} ms")
    name = f"looked at, embedded {figures.model}, one thread"
    table.add_row(name, f"{figures.model_ms:.0f} ms", f"{figures.model_wall_ms:.0f} ms")
    table.add_row("  of which decoding the JPEGs", f"{figures.decode_ms:.0f} ms", "")
    table.add_row("another phrase about the same views", f"{figures.next_phrase_ms:.1f} ms", "")
    verdict = "within" if figures.model_ms <= MARK_MS else "over"
    table.caption = (
        f"looking takes {figures.ratio:.2f} times the rendering's CPU; {verdict} the mark of {MARK_MS:.0f} ms"
    )
    return table


def main() -> None:
    parser = argparse.ArgumentParser(description="Five views: the embedded model against their rendering.")
    parser.add_argument("--json", action="store_true", help="one JSON object on standard output")
    parser.add_argument("--scene", type=Path, default=SAMPLE, help="a sample delivery or a scene document")
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--weights", type=Path, default=FOLDER, help="the trained files")
    options = parser.parse_args()
    with Console(stderr=True).status("starting") as status:
        figures = measure(scene_of(options.scene), max(1, options.rounds), status.update, options.weights)
    met = figures.model_ms <= MARK_MS
    if options.json:
        more = {"ratio": round(figures.ratio, 3), "mark_ms": MARK_MS, "mark_met": met}
        sys.stdout.write(json.dumps(figures._asdict() | more) + "\n")
    else:
        Console().print(shown(figures))
    sys.exit(0 if met else 1)


if __name__ == "__main__":
    main()
