"""`python -m tests.autopilot --port 14540`: the stand-in autopilot as a process.

Told by JSON lines on standard input, it answers each with one on standard output: `{"do": "faults", ...}` sets fields
of `pilot.Faults`, `battery` (0..1) how much is left, `pilot` (a mode) what the pilot's hand chooses, `push` (NED, m/s)
the wind, `jump` (NED, m) how far the estimate leaps, `silence` (s) how long the link is lost, `refuses` (s) how long
it does not arm, `set_anew` (NED, m) by how much its estimate's origin moves, `streams` (hz) how often somebody else
wants its telemetry; `tell` tells how it is.
"""

import argparse
import contextlib
import itertools
import json
import os
import random
import sys
import time
from typing import Any

from tests.autopilot.flight import DT_S, Body
from tests.autopilot.link import Link
from tests.autopilot.pilot import Autopilot

LONGEST_TURN_S = 0.05


def told(autopilot: Autopilot, link: Link) -> dict[str, Any]:
    """How it is; the gaps are between set-points since it was asked last."""
    times, link.set_points = link.set_points, link.set_points[-1:]
    gaps = [b - a for a, b in itertools.pairwise(times)]
    return {
        "mode": autopilot.mode,
        "armed": autopilot.armed,
        "in_air": autopilot.in_air,
        "position": autopilot.body.position,
        "yaw": autopilot.body.yaw,
        "battery": autopilot.battery,
        "set_points": len(gaps),
        "longest_gap_s": max(gaps, default=0.0),
        "offboard_lost": autopilot.offboard_lost,
        "commands": link.commands,
    }


def done(line: dict[str, Any], autopilot: Autopilot, link: Link) -> dict[str, Any]:
    """What one line asks for, and how the autopilot is after it."""
    what = line.pop("do")
    if what == "faults":
        for name, value in line.items():
            assert hasattr(autopilot.faults, name), name
            setattr(autopilot.faults, name, tuple(value) if isinstance(value, list) else value)
    elif what == "battery":
        autopilot.battery = line["left"]
    elif what == "pilot":
        autopilot.set_mode(line["mode"])
    elif what == "push":
        autopilot.body.push = line["m_s"]
    elif what == "jump":
        autopilot.body.position = [p + j for p, j in zip(autopilot.body.position, line["m"], strict=True)]
    elif what == "refuses":
        autopilot.faults.refuse_arming_until_s = autopilot.time_s + line["s"]
    elif what == "set_anew":
        autopilot.set_anew(line["m"])
    elif what == "streams":
        link.stream_at(line["hz"])
    elif what == "silence":
        autopilot.faults.silent_until_s = autopilot.time_s + line["s"]
    return told(autopilot, link)


def main() -> None:
    reader = argparse.ArgumentParser(description=__doc__)
    reader.add_argument("--port", type=int, default=14540)
    reader.add_argument("--firmware", choices=("px4", "ardupilot"), default="px4")
    reader.add_argument("--ekf-s", type=float, default=0.5)
    reader.add_argument("--noise-m", type=float, default=0.02)
    reader.add_argument("--yaw", type=float, default=0.0, help="radians clockwise from north")
    reader.add_argument("--system", type=int, default=1, help="its number on the link")
    reader.add_argument("--company", action="store_true", help="others' heartbeats come at the same port")
    reader.add_argument("--origin", type=float, nargs=3, default=(0.0, 0.0, 0.0), help="where it stands, NED, metres")
    reader.add_argument("--seed", type=int, default=1)
    asked = reader.parse_args()
    stands = list(asked.origin)
    body = Body(stands, ground_m=stands[2], noise_m=asked.noise_m, yaw=asked.yaw, chance=random.Random(asked.seed))
    autopilot = Autopilot(asked.firmware, asked.ekf_s, body=body)
    link = Link(autopilot, asked.port, asked.system, company=asked.company)
    os.set_blocking(sys.stdin.fileno(), False)
    parent, pending = os.getppid(), b""
    began = time.monotonic()
    while os.getppid() == parent:
        link.receive()
        # a machine that is too busy slows the flight down; it does not silence whoever flies it
        began = max(began, time.monotonic() - autopilot.time_s - LONGEST_TURN_S)
        while autopilot.time_s < time.monotonic() - began:
            autopilot.step()
        link.send_due()
        with contextlib.suppress(BlockingIOError):
            pending += os.read(sys.stdin.fileno(), 4096)
        while b"\n" in pending:
            line, _, pending = pending.partition(b"\n")
            sys.stdout.write(json.dumps(done(json.loads(line), autopilot, link)) + "\n")
            sys.stdout.flush()
        time.sleep(DT_S / 2)


if __name__ == "__main__":
    main()
