"""Write the shipped deliveries.

    python -m evaluation.scene_generator.make_samples [--sim URL | --catalogue FILE] [--out DIRECTORY]

Without a simulator or a catalogue it starts a simulator of its own.
"""

import argparse
import sys
from pathlib import Path

from contracts.orchestrator import Sample
from contracts.sim import Catalogue
from evaluation.scene_generator.sample_plans import SAMPLE_PLANS, SamplePlan
from evaluation.scene_generator.scenes import build_scene, scene_difficulty
from evaluation.sim_client import SimClient, own_simulator
from service_kit.connections import Connections
from service_kit.settings import process_environment

SAMPLES = Path(__file__).resolve().parents[2] / "orchestrator" / "samples"


def make_sample(plan: SamplePlan, catalogue: Catalogue) -> Sample:
    """Raises evaluation.scene_generator.scene_plan.UnbuildableScene."""
    return Sample(
        name=plan.spec.name,
        title=plan.title,
        difficulty=scene_difficulty(plan.spec),
        request=plan.request,
        scene=build_scene(plan.spec, plan.seed, catalogue),
    )


def write_samples(directory: Path, catalogue: Catalogue) -> list[Path]:
    """One JSON file a sample. Raises evaluation.scene_generator.scene_plan.UnbuildableScene."""
    directory.mkdir(parents=True, exist_ok=True)
    paths = []
    for plan in SAMPLE_PLANS:
        path = directory / f"{plan.spec.name}.json"
        path.write_text(make_sample(plan, catalogue).model_dump_json(indent=1) + "\n", encoding="utf-8")
        paths.append(path)
    return paths


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m evaluation.scene_generator.make_samples", description="Write the shipped deliveries."
    )
    parser.add_argument("--sim", help="address of a running simulator")
    parser.add_argument("--catalogue", type=Path, help="the simulator's catalogue as a JSON file")
    parser.add_argument("--out", type=Path, default=SAMPLES)
    chosen = parser.parse_args(arguments)
    if chosen.catalogue:
        catalogue = Catalogue.model_validate_json(chosen.catalogue.read_text(encoding="utf-8"))
    elif chosen.sim:
        catalogue = SimClient(chosen.sim, Connections.read(process_environment()).tokens.sim).catalogue()
    else:
        with own_simulator() as simulator:
            catalogue = simulator.catalogue()
    for path in write_samples(chosen.out, catalogue):
        sys.stdout.write(f"{path}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
