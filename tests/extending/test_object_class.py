"""A class of object from a package outside the tree, in the simulator's own process."""

import os
import subprocess
import sys
from pathlib import Path

import httpx

from contracts.cameras import default_rig
from contracts.orchestrator import DeliveryQuestion, MissionSettings
from contracts.scene import Scene
from contracts.sim import Catalogue, Episode, Truth
from launcher.processes import Processes, free_ports, oracle_settings
from mission.clients import Services
from orchestrator import sample_library
from orchestrator.delivery import Order, Run
from service_kit.addresses import FLIGHT_SERVICES
from service_kit.settings import process_environment
from tests.extending.conftest import install
from tests.load.processes import free_port, service
from tests.services.sim.conftest import make_yard


def with_surfboard() -> Scene:
    """A surfboard where the yard has its pot, straight before the drone on the ground floor."""
    scene = make_yard()
    pot = scene.objects[0]
    place = pot.place.model_copy(update={"floor": 1})
    return scene.model_copy(
        update={"objects": (pot.model_copy(update={"kind": "surfboard", "colour": "orange", "place": place}),)}
    )


def test_an_installed_class_is_in_the_catalogue_and_stands_in_scenes(extras: Path) -> None:
    with (
        service("services.sim", {"PYTHONPATH": str(extras), "SIM_TRUTH": "on"}) as sim,
        httpx.Client(base_url=sim.url, timeout=60) as http,
    ):
        catalogue = Catalogue.model_validate_json(http.get("/v1/catalogue").content)
        entry = next(entry for entry in catalogue.entries if entry.kind == "surfboard")
        assert (entry.category, entry.phrase) == ("toys", "surfboard")
        scene = {"scene": with_surfboard().model_dump(mode="json")}
        episode = Episode.model_validate_json(http.post("/v1/episodes", json=scene).content)
        question = {"cameras": [camera.model_dump() for camera in default_rig().cameras]}
        told = Truth.model_validate_json(http.post(f"/v1/episodes/{episode.id}/truth", json=question).content)
        seen = [thing for view in told.views for thing in view.objects]
        assert {(thing.kind, thing.colour, thing.goal) for thing in seen} == {("surfboard", "orange", True)}
        assert max(thing.pixels for thing in seen) > 200


async def test_a_delivery_finds_the_window_with_an_installed_class(extras: Path, tmp_path: Path) -> None:
    sample = sample_library.load("green-flower-pot").scene
    goal, *others = sample.objects
    board = goal.model_copy(update={"kind": "surfboard", "colour": "orange", "scale": 1.0})
    asked = DeliveryQuestion(
        request="fourth floor, the window with the orange surfboard",
        scene=sample.model_copy(update={"name": "surfboard", "objects": (board, *others)}),
        backend="oracle",
        settings=MissionSettings(image_size=320),
    )
    ports = free_ports(FLIGHT_SERVICES)
    environment = process_environment() | {"PYTHONPATH": str(extras), "CACHE_MODE": "off"}
    group = Processes(ports, tmp_path / "logs", environment=environment, extra=oracle_settings(ports))
    async with group, Services(group.addresses) as services:
        result = await Run(Order(asked), tmp_path / "runs").fly(services.simulated())
    assert result.outcome == "delivered", result.message
    assert result.object == "orange surfboard"


def test_a_class_that_is_not_as_large_as_it_says_ends_the_service_with_a_sentence(tmp_path: Path) -> None:
    package = tmp_path / "source"
    (package / "tall_tales").mkdir(parents=True)
    (package / "pyproject.toml").write_text(
        '[project]\nname = "tall-tales"\nversion = "1"\n'
        '[project.entry-points."logisticsvln.catalogue"]\ntales = "tall_tales.things"\n'
    )
    (package / "tall_tales" / "__init__.py").touch()
    (package / "tall_tales" / "things.py").write_text(
        "from services.sim.catalogue.registry import STANDING, catalogued\n"
        "from services.sim.geometry.solids import box\n\n"
        '@catalogued("toys", "giant", colours=("red",), places=STANDING, size_m=(0.3, 0.3, 0.5))\n'
        "def giant(look):\n"
        "    return box((0.3, 0.3, 5.0), (0.0, 0.0, 2.5), look.main)\n"
    )
    site = install(package, tmp_path / "site")
    process = subprocess.run(
        [sys.executable, "-m", "services.sim"],
        env=os.environ | {"PYTHONPATH": str(site), "PORT": str(free_port())},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert process.returncode == 1
    assert "giant is (0.3, 0.3, 5.0) m large, not size_m=(0.3, 0.3, 0.5)" in process.stderr
    assert "Traceback" not in process.stderr
