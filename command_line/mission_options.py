"""The command line's options that make a mission's settings: the same words for one delivery and for a whole arm."""

from typing import Annotated, Literal

import typer

from contracts.depth_assist import ViewpointSettings
from contracts.orchestrator import MissionSettings, SightingSettings
from contracts.sim import Flight

SEED_HIGH = 2**31 - 1

ViewpointPolicy = Literal["paper", "contour", "random", "default"]
ChoicePolicy = Literal["model", "centre"]
FloorMethod = Literal["stepwise", "direct-count"]
SightingPolicy = Literal["look-again", "claim-at-first-sight"]

Backend = Annotated[str, typer.Option(help="Who answers about pictures: embedded, oracle, or an alias of the gateway.")]
Viewpoint = Annotated[
    ViewpointPolicy | None,
    typer.Option(
        help="How to search: the contour explorer, the paper's rule, or an ablation of that rule.",
        show_default="contour; with --choice paper",
    ),
]
Choice = Annotated[
    ChoicePolicy | None,
    typer.Option(help="Ablation of the paper's rule: who picks one of its points.", show_default="model"),
]
Floors = Annotated[FloorMethod, typer.Option(help="Ablation.")]
Sightings = Annotated[
    SightingPolicy,
    typer.Option(help="Look at a sighting from nearer before it is claimed, or claim it as the paper does."),
]
Drift = Annotated[
    float, typer.Option(min=0, max=0.1, help="How far the reported pose strays per metre flown; 0.01 is 1 %.")
]
Parser = Annotated[str | None, typer.Option(help="The parser's model; its own default without it.")]
MaxSteps = Annotated[int, typer.Option(min=1, max=200, help="Exploration steps at most.")]
ImageSize = Annotated[int, typer.Option(min=64, max=1600, help="Pictures are square; pixels.")]


def mission_settings(
    *,
    viewpoint: ViewpointPolicy | None,
    choice: ChoicePolicy | None,
    floors: FloorMethod,
    sightings: SightingPolicy,
    drift: float,
    parser: str | None,
    max_steps: int,
    image_size: int,
    seed: int,
) -> MissionSettings:
    """Without a `viewpoint` the contour explorer, or where a `choice` is asked for the paper's rule, which alone has
    points to choose from. Raises ValueError for a choice together with the explorer."""
    if viewpoint == "contour" and choice is not None:
        raise ValueError("--choice belongs to the paper's rule: add --viewpoint paper, or leave --choice out")
    policy = viewpoint or ("contour" if choice is None else "paper")
    return MissionSettings(
        floors=floors,
        choice=choice or "model",
        viewpoint=ViewpointSettings(policy=policy),
        sightings=SightingSettings(policy=sightings),
        flight=Flight(drift=drift),
        parser_model=parser,
        max_exploration_steps=max_steps,
        image_size=image_size,
        seed=seed,
    )
