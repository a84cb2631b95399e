"""The command line's options that make a mission's settings: the same words for one delivery and for a whole arm."""

from typing import Annotated, Literal

import typer

from contracts.cameras import load_rig, rig_names
from contracts.orchestrator import MissionSettings, SearchSettings, SightingSettings
from contracts.sensor_profiles import load_sensors, sensor_names
from contracts.sim import Flight
from mission.policies import DEFAULT, OWN, completed

SEED_HIGH = 2**31 - 1

ChoicePolicy = Literal["model", "centre"]
FloorMethod = Literal["stepwise", "direct-count"]
SightingPolicy = Literal["look-again", "claim-at-first-sight"]

Backend = Annotated[str, typer.Option(help="Who answers about pictures: embedded, oracle, or an alias of the gateway.")]
BackendOrRoles = Annotated[
    str | None,
    typer.Option(
        help="Who answers about pictures: embedded, oracle, or an alias of the gateway.",
        show_default="whom the gateway's roles name: embedded, or as GATEWAY_CONFIG says",
    ),
]
Viewpoint = Annotated[
    str | None,
    typer.Option(
        help=f"How to search: {', '.join(policy.name for policy in OWN)}, or what an installed package brings.",
        show_default=DEFAULT,
    ),
]
Choice = Annotated[
    ChoicePolicy | None,
    typer.Option(help="Ablation of the policies that have points to choose from: who picks one.", show_default="model"),
]
Floors = Annotated[FloorMethod, typer.Option(help="Ablation.")]
Sightings = Annotated[
    SightingPolicy,
    typer.Option(help="Look at a sighting from nearer before it is claimed, or claim it as the paper does."),
]
Drift = Annotated[
    float, typer.Option(min=0, max=0.1, help="How far the reported pose strays per metre flown; 0.01 is 1 %.")
]
FaultRate = Annotated[
    float, typer.Option(min=0, max=1, help="Frozen frames, no depth, a jump of the position: each at so many flights.")
]
FaultSeed = Annotated[int, typer.Option(min=0, max=SEED_HIGH, help="Of these faults.")]
Parser = Annotated[str | None, typer.Option(help="The parser's model; its own default without it.")]
GroundFloor = Annotated[
    int | None,
    typer.Option(
        min=0,
        max=1,
        help='How a plain "first floor" counts: 1, it is at street level, or 0, it is one up.',
        show_default="as the parser is set up",
    ),
]
MaxSteps = Annotated[int, typer.Option(min=1, max=200, help="Exploration steps at most.")]
RigName = Annotated[
    str, typer.Option("--rig", help=f"The drone's cameras: {', '.join(rig_names())}, or a file (docs/rigs.md).")
]
ImageSize = Annotated[
    int | None,
    typer.Option(
        min=64, max=1600, help="Longer side of every camera's pictures, pixels.", show_default="as the rig says"
    ),
]
SensorsName = Annotated[
    str | None,
    typer.Option(
        "--sensors",
        help=f"What the drone senses with: {', '.join(sensor_names())}, or a file (docs/sim-to-real.md).",
        show_default="as the scene says, else perfect",
    ),
]


def mission_settings(
    *,
    viewpoint: str | None,
    choice: ChoicePolicy | None,
    floors: FloorMethod,
    sightings: SightingPolicy,
    drift: float,
    parser: str | None,
    max_steps: int,
    rig: str,
    image_size: int | None,
    seed: int,
    ground_floor: int | None = None,
    sensors: str | None = None,
) -> MissionSettings:
    """The settings with the search policy named and complete. Raises ValueError for a policy that there is not, one
    that has no `choice`, a rig or a sensor profile that is none."""
    constants = {"choice": choice} if choice is not None else {}
    settings = MissionSettings(
        floors=floors,
        viewpoint=SearchSettings(policy=viewpoint, **constants),
        sightings=SightingSettings(policy=sightings),
        flight=Flight(drift=drift),
        parser_model=parser,
        ground_floor=None if ground_floor is None else 1 if ground_floor else 0,
        max_exploration_steps=max_steps,
        rig=load_rig(rig),
        image_size=image_size,
        sensors=None if sensors is None else load_sensors(sensors),
        seed=seed,
    )
    return completed(settings)
