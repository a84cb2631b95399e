"""Latency of depth_assist over HTTP: `python tests/load/bench_depth_assist.py [--json]`.

Starts the service as a process, sends one request after the other on one connection, prints p50/p95/p99 per route.
The depth maps are those of a street: a facade with window reveals and balconies on the right, the ground, a house
across the street, sky without returns. `--noise-m` adds noise, which is what makes depth maps large: its default
brings the five to about 220 KB, as the simulator's are (110-550 KB). `cpu` is the service's own processor time per
request, which other load on the machine changes less than the latencies.
"""

import argparse
import http.client
import json
import os
import socket
import subprocess
import sys
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contracts.cameras import default_rig
from contracts.depth_assist import (
    ApproachQuestion,
    ExploreQuestion,
    SafeDistancesQuestion,
    ViewDepth,
    ViewpointQuestion,
)
from contracts.geometry import Box, Pose
from contracts.images import encode_depth

Array = NDArray[np.float64]
FLIGHT_HEIGHT_M = 8.0
WALL_M = 9.0
SENSOR_RANGE_M = 60.0


def street_depth(heading_deg: float, size: int, noise_m: float, generator: np.random.Generator) -> Array:
    """(size, size) planar depth from 9 m in front of a long facade on the right, flying along it."""
    slopes = (np.arange(size) + 0.5 - size / 2) / (size / 2)
    angle = np.radians(heading_deg)
    forward = np.cos(angle) - slopes * np.sin(angle)  # of a ray of planar depth 1, nose frame
    right = np.sin(angle) + slopes * np.cos(angle)
    up = -slopes[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        ground = np.where(up < 0, FLIGHT_HEIGHT_M / -up, np.inf) * np.ones(size)
        wall = _wall(WALL_M / right, forward, up, FLIGHT_HEIGHT_M + 16.0, -30.0, 14.0)
        across = _wall(-22.0 / right, forward, up, 10.0, -40.0, 25.0)
    depth = np.minimum(np.minimum(ground, wall), across)
    depth = depth + generator.normal(0.0, noise_m, depth.shape) if noise_m else depth
    return np.where(depth <= SENSOR_RANGE_M, depth, np.inf)


def _wall(t: Array, forward: Array, up: Array, height_m: float, start_m: float, end_m: float) -> Array:
    """Planar depth of a wall with a grid of 3 m windows 0.2 m deep and a balcony slab to each floor."""
    along = t * forward
    z = FLIGHT_HEIGHT_M + t * up
    hit = (t > 0) & (along > start_m) & (along < end_m) & (z > 0) & (z < height_m)
    window = (np.mod(along, 3.0) < 1.4) & (np.mod(z, 3.0) > 0.9) & (np.mod(z, 3.0) < 2.4)
    slab = np.mod(z, 3.0) < 0.15
    return np.where(hit, t * (1.0 + 0.02 * window - 0.1 * slab), np.inf)


def questions(size: int, noise_m: float) -> dict[str, bytes]:
    """Route to body."""
    generator = np.random.default_rng(1)
    views = {
        camera.name: ViewDepth(
            camera=camera, depth=encode_depth(street_depth(camera.heading_deg, size, noise_m, generator))
        )
        for camera in default_rig().scaled_to(size).cameras
    }
    front, sides = views["front"], (views["front-left"], views["front-right"])
    box = Box(x_min=0.1, y_min=0.1, x_max=0.95, y_max=0.9)
    seen = Box(x_min=0.60, y_min=0.48, x_max=0.63, y_max=0.52)
    pose = Pose(x=0.0, y=0.0, z=FLIGHT_HEIGHT_M, yaw=0.0)
    return {
        "viewpoint": ViewpointQuestion(views=tuple(views.values()), building_box=box).model_dump_json().encode(),
        "safe-distances": SafeDistancesQuestion(view=front, others=sides).model_dump_json().encode(),
        "safe-distances, one view": SafeDistancesQuestion(view=front).model_dump_json().encode(),
        "approach": ApproachQuestion(view=views["right"], others=(views["front-right"],), box=seen, pose=pose)
        .model_dump_json()
        .encode(),
        "explore": ExploreQuestion(views=tuple(views.values()), pose=pose, building_box=None)
        .model_dump_json()
        .encode(),
    }


def cpu_s(pid: int) -> float:
    """Processor time of a process so far, from the kernel."""
    with open(f"/proc/{pid}/stat", encoding="ascii") as stat:
        fields = stat.read().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def measure(pid: int, port: int, route: str, body: bytes, seconds: float) -> dict[str, float]:
    """Closed loop, one connection, for so many seconds after 5 warm-up requests."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=30)
    taken_ms: list[float] = []
    end = time.perf_counter() + seconds
    count = 0
    cpu_before = cpu_s(pid)
    while time.perf_counter() < end or count < 25:
        started = time.perf_counter()
        connection.request("POST", f"/v1/{route}", body, {"Content-Type": "application/json"})
        answer = connection.getresponse()
        data = answer.read()
        count += 1
        if answer.status != 200:
            raise SystemExit(f"{route}: {answer.status} {data[:300]!r}")
        if count > 5:
            taken_ms.append((time.perf_counter() - started) * 1e3)
    p50, p95, p99 = np.percentile(taken_ms, (50, 95, 99))
    return {
        "requests": len(taken_ms),
        "body_kb": round(len(body) / 1024, 1),
        "p50_ms": round(float(p50), 2),
        "p95_ms": round(float(p95), 2),
        "p99_ms": round(float(p99), 2),
        "cpu_ms": round((cpu_s(pid) - cpu_before) / count * 1e3, 2),
        "requests_per_s": round(len(taken_ms) / (sum(taken_ms) / 1e3), 1),
    }


def start_service(one_core: bool) -> tuple[subprocess.Popen[bytes], int]:
    """The real service on a free port, ready."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = int(free.getsockname()[1])
    process = subprocess.Popen([sys.executable, "-m", "services.depth_assist"], env={**os.environ, "PORT": str(port)})
    if one_core:
        os.sched_setaffinity(process.pid, {min(os.sched_getaffinity(0))})
    deadline = time.monotonic() + 30
    while time.monotonic() < deadline and process.poll() is None:
        try:
            connection = http.client.HTTPConnection("127.0.0.1", port, timeout=1)
            connection.request("GET", "/readyz")
            if connection.getresponse().status == 200:
                return process, port
        except OSError:
            time.sleep(0.05)
    process.terminate()
    raise SystemExit("depth_assist did not become ready within 30 s")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--size", type=int, default=800, help="pixels each way")
    parser.add_argument("--noise-m", type=float, default=0.00015, help="standard deviation of sensor noise, metres")
    parser.add_argument("--seconds", type=float, default=4.0, help="per route")
    parser.add_argument("--one-core", action="store_true", help="pin the service to one core")
    options = parser.parse_args()
    bodies = questions(options.size, options.noise_m)
    process, port = start_service(options.one_core)
    try:
        figures: dict[str, Any] = {
            name: measure(process.pid, port, name.partition(",")[0], body, options.seconds)
            for name, body in bodies.items()
        }
    finally:
        process.terminate()
        process.wait(10)
    if options.json:
        settings = {"size": options.size, "noise_m": options.noise_m, "one_core": options.one_core}
        sys.stdout.write(json.dumps({"service": "depth_assist", **settings, "routes": figures}) + "\n")
        return
    for name, row in figures.items():
        sys.stdout.write(
            f"{name:26} {row['body_kb']:8.1f} KB  p50 {row['p50_ms']:7.2f}  p95 {row['p95_ms']:7.2f}  "
            f"p99 {row['p99_ms']:7.2f} ms  cpu {row['cpu_ms']:6.2f} ms"
            f"  {row['requests_per_s']:6.1f}/s\n"
        )


if __name__ == "__main__":
    main()
