"""`python -m tests.carla_double`: the double at CARLA's usual port, its maps the sample deliveries' streets."""

import argparse
import logging
import signal
from pathlib import Path

from contracts.scene import Scene
from orchestrator import sample_library
from services.sim.bootstrap import build_scene
from tests.carla_double.running import running_double
from tests.carla_double.simulation import VERSION
from tests.services.sim.conftest import build_boxes, make_yard


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.carla_double", description=__doc__)
    parser.add_argument("--port", type=int, default=2000, help="of the remote calls; the next one has the streams")
    parser.add_argument("--late", type=int, default=0, help="ticks by which pictures lag behind their cameras")
    parser.add_argument("--blind", action="store_true", help="no camera ever sends a picture")
    parser.add_argument("--release", default=VERSION, help="which release of CARLA it says that it is")
    parser.add_argument("--yard", action="store_true", help="one map, the yard of the simulator's tests")
    parser.add_argument("--documents", type=Path, help="a folder: writes where the samples' scenes lie, and ends")
    asked = parser.parse_args()
    logging.basicConfig(level="INFO", format="%(message)s")
    samples: list[Scene] = [sample_library.load(name).scene for name in sample_library.names()]
    if asked.documents is not None:
        write_documents(samples, asked.documents)
        return
    maps, build = ([make_yard()], build_boxes) if asked.yard else (samples, build_scene)
    faults = {"follows_late": asked.late, "blind": asked.blind, "version": asked.release}
    with running_double(maps, build, asked.port, **faults) as double:
        logging.info("listening at %s; maps: %s", double.address, ", ".join(scene.name for scene in maps))
        signal.sigwait({signal.SIGINT, signal.SIGTERM})


def write_documents(scenes: list[Scene], folder: Path) -> None:
    """Each scene is a map of the double's own, with the origin where the scene has it."""
    folder.mkdir(parents=True, exist_ok=True)
    for scene in scenes:
        (folder / f"{scene.name}.toml").write_text(f'map = "{scene.name}"\n', encoding="utf-8")


if __name__ == "__main__":
    main()
