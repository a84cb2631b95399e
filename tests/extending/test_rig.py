"""A camera rig from a file outside the tree: the simulator carries it as it is, and deliveries fly with it."""

import json
import subprocess
import sys
from pathlib import Path

import httpx

from contracts.cameras import load_rig
from contracts.events import LookEvent
from contracts.images import decode_depth, decode_jpeg
from contracts.sim import Episode
from contracts.vehicle import Observation, VehicleCapabilities
from mission.record import read_events
from tests.extending.conftest import EXAMPLE
from tests.load.processes import service
from tests.services.sim.conftest import make_yard

HEXAGON = EXAMPLE / "hexagon.toml"


def test_a_rig_from_a_file_is_carried_and_seen_through() -> None:
    rig = load_rig(str(HEXAGON))
    assert [camera.heading_deg for camera in rig.cameras] == [0.0, 60.0, 120.0, 180.0, -120.0, -60.0]
    with service("services.sim") as sim, httpx.Client(base_url=sim.url, timeout=60) as http:
        asked = {"scene": make_yard().model_dump(mode="json"), "rig": rig.scaled_to(96).model_dump(mode="json")}
        base = f"/v1/episodes/{Episode.model_validate_json(http.post('/v1/episodes', json=asked).content).id}"
        carried = VehicleCapabilities.model_validate_json(http.get(f"{base}/capabilities").content)
        assert carried.cameras == rig.scaled_to(96).cameras
        seen = Observation.model_validate_json(http.get(f"{base}/observation").content)
        assert [view.camera.name for view in seen.views] == [camera.name for camera in rig.cameras]
        ahead, behind = (next(v for v in seen.views if v.camera.name == name) for name in ("front", "back"))
        assert decode_jpeg(ahead.image).shape == (96, 96, 3)
        # the house stands 10 m before the drone; behind it, at eye level and above, there is nothing
        assert ahead.depth is not None
        assert behind.depth is not None
        middle = decode_depth(ahead.depth)[40, 48]
        assert 8.0 < middle < 12.0
        assert decode_depth(behind.depth)[20, 48] > 30.0


def test_a_delivery_flies_with_it_by_the_name_of_the_file(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "command_line", "deliver", "--sample", "green-flower-pot"]
    options = ["--backend", "oracle", "--rig", str(HEXAGON), "--image-size", "320", "--out", str(tmp_path), "--json"]
    flown = subprocess.run([*command, *options], capture_output=True, text=True, timeout=150)
    told = json.loads(flown.stdout)
    assert told["outcome"] == "delivered", flown.stderr
    looks = [event for event in read_events(Path(told["folder"])) if isinstance(event, LookEvent)]
    assert looks
    names = {camera.name for camera in load_rig(str(HEXAGON)).cameras}
    for look in looks:
        assert {view.camera.name for view in look.data.views} == names
        assert all(look.picture(view.picture) for view in look.data.views)
