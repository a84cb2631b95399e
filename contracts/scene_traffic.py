"""What moves in a scene: people who walk, cars that drive, birds that fly round.

Where a mover is follows from the document and the seconds of the episode's own clock alone, the clock that states and
observations carry as `time_s`. `services.sim.geometry.courses` works it out.
"""

from itertools import pairwise
from math import dist
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from contracts.base import Name, Rgb, Unit, Wire
from contracts.geometry import Point2, Point3

MAX_MOVERS = 60
SHORTEST_LEG_M = 0.5
LOWEST_BIRD_M, HIGHEST_BIRD_M = 1.0, 100.0
Way = tuple[Point2, ...]


def _walkable(way: Way) -> Way:
    """No leg so short that it has no direction."""
    for number, (a, b) in enumerate(pairwise(way)):
        _must_lead_somewhere(number, dist((a.x, a.y), (b.x, b.y)))
    return way


def _flyable(way: tuple[Point3, ...]) -> tuple[Point3, ...]:
    """The leg that closes the loop included."""
    for number, (a, b) in enumerate(zip(way, (*way[1:], way[0]), strict=True)):
        _must_lead_somewhere(number, dist((a.x, a.y), (b.x, b.y)))
        if not LOWEST_BIRD_M <= a.z <= HIGHEST_BIRD_M:
            raise ValueError(f"birds fly {LOWEST_BIRD_M:g} to {HIGHEST_BIRD_M:g} m above ground, not at {a.z:g} m")
    return way


def _must_lead_somewhere(number: int, length_m: float) -> None:
    if length_m < SHORTEST_LEG_M:
        raise ValueError(
            f"leg {number} of the way is {length_m:.2f} m long on the plan; at least {SHORTEST_LEG_M:g} m are needed"
        )


class Person(Wire):
    """Walks `way` to its end and back again, for ever. `colour` is the coat's. `phase`: how much of a round, there and
    back, is walked at time 0."""

    kind: Literal["person"] = "person"
    id: Name
    way: Annotated[Way, Field(min_length=2, max_length=32), AfterValidator(_walkable)]
    speed_m_s: float = Field(default=1.3, ge=0.2, le=3.0)
    phase: Unit = 0.0
    height_m: float = Field(default=1.75, ge=0.9, le=2.1)
    colour: Rgb = "#3b5a78"


class MovingCar(Wire):
    """Drives `way` from its start to its end, and appears at the start again: let both lie where nobody looks."""

    kind: Literal["car"] = "car"
    id: Name
    way: Annotated[Way, Field(min_length=2, max_length=32), AfterValidator(_walkable)]
    speed_m_s: float = Field(default=8.0, ge=0.5, le=20.0)
    phase: Unit = 0.0
    colour: Rgb = "#8a8f98"


class Bird(Wire):
    """Flies round: from the last point of `way` to the first again. It makes way for a drone."""

    kind: Literal["bird"] = "bird"
    id: Name
    way: Annotated[tuple[Point3, ...], Field(min_length=3, max_length=32), AfterValidator(_flyable)]
    speed_m_s: float = Field(default=8.0, ge=2.0, le=20.0)
    phase: Unit = 0.0
    colour: Rgb = "#3a3d42"


Mover = Annotated[Person | MovingCar | Bird, Field(discriminator="kind")]
Traffic = Annotated[tuple[Mover, ...], Field(max_length=MAX_MOVERS)]


def same_names(traffic: tuple[Mover, ...]) -> list[str]:
    """Ids that more than one mover has."""
    ids = [mover.id for mover in traffic]
    return sorted({name for name in ids if ids.count(name) > 1})
